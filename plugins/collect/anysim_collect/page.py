"""The report as one self-contained page: success by command, types of failures, retries, and where time went."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any

from anysim_collect.report import MIXTURE_COLUMNS, mixture_rows

WIDTH, HEIGHT = 240, 14
"""[px] of a bar."""


def page(report: Mapping[str, Any]) -> str:
    """HTML that is also well-formed XML; the same bytes for the same report."""
    css = files("anysim_collect").joinpath("page.css").read_text("utf-8")
    title = f"{report['task']} on {report['engine']}"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/><title>{escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"/><style>\n{css}</style></head>\n<body>\n'
        + "\n".join(_body(report, title))
        + "\n</body></html>\n"
    )


def _body(report: Mapping[str, Any], title: str) -> Iterator[str]:
    attempts, successes = report["attempts"], report["successes"]
    low, high = report["interval"]
    yield f"<h1>{escape(title)}</h1>"
    yield (
        f'<p class="soft">{escape(str(report["engine_version"]))}, {report["num_envs"]} envs, seed {report["seed"]}, '
        f"{report['steps']:,} control steps</p>"
    )
    share = f"{successes / attempts:.1%}" if attempts else "no attempt"
    yield f'<p class="big">{share}</p><p>{successes} of {attempts} attempts succeeded (95 %: {low:.0%} to {high:.0%}).'
    cost = report["cpu_s_per_kept"]
    each = "" if cost is None else f"; {cost:.2f} CPU seconds each"
    yield f"{report['kept']} trajectories kept, {report['kept_bytes'] / 1e6:,.1f} MB{each}.</p>"
    commands = report["commands"]
    yield from _table(
        "By command",
        ("command", "begun", "succeeded", "", "95 %", "failures"),
        [
            (
                one["command"],
                one["begun"],
                one["succeeded"],
                _share(one["succeeded"] / one["begun"], one["interval"]),
                "{:.0%} to {:.0%}".format(*one["interval"]),
                ", ".join(f"{count} {why}" for why, count in one["failures"].items()),
            )
            for one in commands
        ],
    )
    for title_, counts in (("Failures", report["failures"]), ("Retries", report["ladder"])):
        most = max(counts.values(), default=1)
        rows = [(name, count, _share(count / most)) for name, count in counts.items()]
        yield from _table(title_, ("type" if title_ == "Failures" else "failed -> tried next", "times", ""), rows)
    total = sum(report["wall_s"].values()) or 1.0
    parts = [(name, f"{s:.2f}", _share(s / total)) for name, s in report["wall_s"].items()]
    yield from _table("Where the time went", ("part", "seconds", ""), parts)
    yield from _table("Mixture", MIXTURE_COLUMNS, mixture_rows(report["mixture"]))
    yield from _table("Planning", ("", ""), [(name, f"{value:g}") for name, value in report["planning"].items()])


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> Iterator[str]:
    if not rows:
        return
    yield f"<h2>{escape(title)}</h2><table><tr>" + "".join(f"<th>{escape(c)}</th>" for c in columns) + "</tr>"
    for row in rows:
        yield "<tr>" + "".join(_cell(cell) for cell in row) + "</tr>"
    yield "</table>"


def _cell(value: Any) -> str:
    if isinstance(value, _Drawing):
        return f"<td>{value}</td>"
    return f'<td class="n">{value:,}</td>' if isinstance(value, int) else f"<td>{escape(str(value))}</td>"


class _Drawing(str):
    """Markup that is no text."""


def _share(share: float, interval: Sequence[float] | None = None) -> _Drawing:
    """A bar of a share, with a line where it may be."""
    marks = ""
    if interval is not None:
        low, high = (f"{WIDTH * bound:.1f}" for bound in interval)
        marks = f'<line class="range" x1="{low}" x2="{high}" y1="{HEIGHT / 2:g}" y2="{HEIGHT / 2:g}"/>'
    return _Drawing(
        f'<svg width="{WIDTH}" height="{HEIGHT}" role="img" aria-label="{share:.0%}">'
        f'<rect class="ground" width="{WIDTH}" height="{HEIGHT}"/>'
        f'<rect class="bar" width="{WIDTH * share:.1f}" height="{HEIGHT}"/>{marks}</svg>'
    )
