"""The page of a benchmark: who solves what on which engine, whether engines agree, and all figures behind it."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from anysim_evaluation.page import drawn, table, whole

SIDE = 220
"""[px] of a scatter plot."""

Summary = Mapping[str, Any]


def page(told: Summary) -> str:
    """HTML that is also well-formed XML; the same bytes for the same results."""
    title = escape(f"Benchmark {told['protocol']}")
    return whole(title, _body(told, title))


def figure(value: float | None, form: str = ".2f") -> str:
    """A figure, or nothing where there is none."""
    return "" if value is None else format(value, form)


def _body(told: Summary, title: str) -> Iterator[str]:
    yield f"<h1>{title}</h1><p>{escape(told['description'])}</p>"
    yield f"<p>{told['episodes']} episodes of each task, policy and engine; seeds {escape(told['parts']['seeds'])}.</p>"
    yield f"<p>Frozen as <code>{told['frozen'][:16]}</code>. Intervals are at 95 %.</p>"
    if told["moved"]:
        yield f"<p><b>These are no results of the protocol:</b> {escape('; '.join(told['moved']))}.</p>"
    if told["left"]:
        yield f"<p><b>{told['left']} episodes are still to be run.</b></p>"
    engines = list(dict.fromkeys(one["engine"] for one in told["means"]))
    yield from _means(told["means"], engines)
    yield from _tasks(told["rows"], engines)
    yield from _scatters(told["rows"], engines)
    yield from table("Order of the policies", *ranks(told))
    yield from table("Agreement of engines, seed by seed", *agreement(told))
    yield from table("Policies against the reference, on the same seeds", *paired(told))
    yield from table("Trained here, evaluated there", *matrix(told))
    yield from table("All figures", *_all(told["rows"]))
    absent = [[escape(one[key]) for key in ("task", "engine", "policy", "why")] for one in told["absent"]]
    yield from table("Not run", ("task", "engine", "policy", "why"), absent)


def _means(means: Sequence[Summary], engines: Sequence[str]) -> Iterator[str]:
    by_cell = {(one["policy"], one["engine"]): one for one in means}
    policies = list(dict.fromkeys(one["policy"] for one in means))
    rows = [[escape(policy), *(_bar(by_cell.get((policy, engine))) for engine in engines)] for policy in policies]
    yield from table("Mean success over the tasks", ("policy", *map(escape, engines)), rows)


def _bar(one: Summary | None) -> str:
    if one is None:
        return ""
    low, high = one["interval"]
    return f"{drawn(one['success'], one['interval'])} {one['success']:.0%} <small>({low:.0%} to {high:.0%})</small>"


def _tasks(rows: Sequence[Summary], engines: Sequence[str]) -> Iterator[str]:
    """Success by task and policy, the engines beside each other in a cell; the higher, the darker the ground."""
    by_cell = {(one["task"], one["policy"], one["engine"]): one for one in rows}
    policies = list(dict.fromkeys(one["policy"] for one in rows))
    lines: list[list[str]] = []
    for task in dict.fromkeys(one["task"] for one in rows):
        shades = ("".join(_shade(by_cell.get((task, policy, engine))) for engine in engines) for policy in policies)
        lines.append([escape(task), *(f'<span class="cells">{cell}</span>' for cell in shades)])
    title = f"Success by task in percent: {', '.join(map(escape, engines))}"
    yield from table(title, ("task", *(p.replace("_", " ") for p in policies)), lines)


def _shade(one: Summary | None) -> str:
    if one is None or one["success"] is None:
        return '<span class="cell">?</span>'
    share = one["success"]
    ink = "#fff" if share > 0.55 else "#222"
    ground = f"rgba(51, 102, 153, {share:.2f})"
    return f'<span class="cell" style="background: {ground}; color: {ink}">{100 * share:.0f}</span>'


def _scatters(rows: Sequence[Summary], engines: Sequence[str]) -> Iterator[str]:
    if len(engines) < 2:
        return
    found = {(one["task"], one["policy"], one["engine"]): one["success"] for one in rows}
    yield "<h2>Success on one engine by that on another, a point for each task and policy</h2><div>"
    for second in engines[1:]:
        points = [
            (share, found[task, policy, second])
            for (task, policy, engine), share in found.items()
            if engine == engines[0] and share is not None and found.get((task, policy, second)) is not None
        ]
        yield _scatter(escape(engines[0]), escape(second), points)
    yield "</div>"


def _scatter(x: str, y: str, points: Sequence[tuple[float, float]]) -> str:
    edge = 24
    dots = "".join(
        f'<circle cx="{edge + a * SIDE:.1f}" cy="{edge + (1 - b) * SIDE:.1f}" r="4" fill="#369" fill-opacity="0.4"/>'
        for a, b in points
    )
    full = SIDE + 2 * edge
    return (
        f'<svg width="{full}" height="{full}"><rect x="{edge}" y="{edge}" width="{SIDE}" height="{SIDE}" fill="#eee"/>'
        f'<line x1="{edge}" y1="{edge + SIDE}" x2="{edge + SIDE}" y2="{edge}" stroke="#bbb"/>{dots}'
        f'<text x="{edge}" y="{full - 6}" font-size="13">{x}: 0 to 100 % →</text>'
        f'<text x="{edge}" y="16" font-size="13">{y} ↑</text></svg>'
    )


Table = tuple[Sequence[str], Sequence[Sequence[str]]]


def ranks(told: Summary) -> Table:
    """How far the engines order the policies as the reference does: columns and rows."""
    columns = (
        "engine",
        "against",
        "task",
        "policies",
        "Kendall",
        "Pearson",
        "MMRV",
        "reversed",
        "tolerant",
        "reversed",
    )
    measures = ("kendall", "pearson", "mmrv", "mmrv_reversed", "mmrv_tolerant", "mmrv_tolerant_reversed")
    order = sorted(told["ranks"], key=lambda one: one["task"] is not None)
    return columns, [
        [
            escape(one["engine"]),
            escape(one["reference"]),
            escape(one["task"] or "mean over tasks"),
            str(one["policies"]),
            *(figure(one[name], ".3f") for name in measures),
        ]
        for one in order
    ]


def agreement(told: Summary) -> Table:
    """How far two engines have the same outcomes on the same seeds: columns and rows."""
    columns = ("engines", "policy", "episodes", "same outcome", "kappa", "one alone", "more success", "95 %", "p")
    order = sorted(told["engines"], key=lambda one: one["policy"] is not None)
    return columns, [
        [f"{escape(one['first'])} and {escape(one['second'])}", escape(one["policy"] or "all"), *_pair(one)]
        for one in order
    ]


def paired(told: Summary) -> Table:
    """Each policy against the reference: columns and rows."""
    columns = ("engine", "policies", "episodes", "same outcome", "kappa", "one alone", "more success", "95 %", "p")
    return columns, [
        [escape(one["engine"]), f"{escape(one['first'])} and {escape(one['second'])}", *_pair(one)]
        for one in told["policies"]
    ]


def _pair(one: Summary) -> list[str]:
    alone = f"{one['only_first']} and {one['only_second']}"
    gap = f"{one['gap']:+.1%}", "{:+.1%} to {:+.1%}".format(*one["gap_interval"])
    return [str(one["seeds"]), f"{one['agree']:.1%}", figure(one["kappa"]), alone, *gap, figure(one["p"], ".3g")]


def matrix(told: Summary) -> Table:
    """Mean success by the engine that policies were trained on and the one they are evaluated on: columns and rows."""
    engines = list(dict.fromkeys(one["engine"] for one in told["matrix"]))
    found = {
        (one["trained_on"], one["engine"]): "{:.0%} ({:.0%} to {:.0%})".format(one["success"], *one["interval"])
        for one in told["matrix"]
    }
    trained = list(dict.fromkeys(one["trained_on"] for one in told["matrix"]))
    rows = [[escape(a), *(found.get((a, b), "") for b in engines)] for a in trained]
    return ("trained on", *map(escape, engines)), rows


def _all(rows: Sequence[Summary]) -> Table:
    columns = ("task", "engine", "policy", "episodes", "success", "95 %", "failed", "out of time", "length")
    return (*columns, "commands done", "retries", "simulated s", "failures", "faults"), [
        [
            *(escape(one[key]) for key in ("task", "engine", "policy")),
            str(one["attempts"]),
            figure(one["success"], ".0%"),
            "{:.0%} to {:.0%}".format(*one["success_interval"]),
            figure(one["failure"], ".0%"),
            figure(one["truncation"], ".0%"),
            figure(one["length"]),
            figure(one["commands_done"], ".0%"),
            figure(one["retries_per_success"]),
            figure(one["sim_s_per_success"], ".1f"),
            escape(", ".join(f"{count} {kind}" for kind, count in one["failures"].items())),
            str(one["faults"]),
        ]
        for one in rows
    ]
