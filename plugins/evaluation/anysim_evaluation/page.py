"""An evaluation as one page: rates with their intervals drawn, failures by type, agreement, videos beside it."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

from anysim_evaluation.summary import ground_table

WIDTH, HEIGHT = 240, 16
"""[px] of a drawn interval."""


def page(told: Mapping[str, Any]) -> str:
    """HTML that is also well-formed XML; the same bytes for the same evaluation."""
    title = escape(f"{told['policy']} on {told['task']}")
    return whole(title, _body(told, title))


def whole(title: str, lines: Iterator[str]) -> str:
    """A page that needs no other file."""
    css = files("anysim_evaluation").joinpath("page.css").read_text("utf-8")
    head = f'<meta charset="utf-8"/><title>{title}</title><style>\n{css}</style>'
    body = "\n".join(lines)
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n<body>\n{body}\n</body></html>\n'


def _body(told: Mapping[str, Any], title: str) -> Iterator[str]:
    level = "".join(f", {key} {told[key]}" for key in ("level", "robot") if told[key])
    yield f"<h1>{title}</h1><p>{told['num_episodes']} episodes of the split {escape(told['split'])}{escape(level)}.</p>"
    engines: Mapping[str, Any] = told["engines"]
    rows = [
        [
            escape(name),
            f"{one['successes']} of {one['attempts']}",
            drawn(one["success_rate"], one["interval"]),
            "{:.0%} to {:.0%}".format(*one["interval"]),
            "" if one["steps"] is None else f"{one['steps']:g}",
            str(one["faults"]),
        ]
        for name, one in engines.items()
    ]
    yield from table("Success", ("engine", "solved", "", "95 %", "steps", "faults"), rows)
    for name, one in engines.items():
        columns, cells = ground_table(one["ground"])
        yield from table(f"Success by ground, {name}", columns, [[escape(cell) for cell in row] for row in cells])
    kinds = sorted({kind for one in engines.values() for kind in one["failures"]})
    counts = [[escape(kind), *(str(one["failures"].get(kind, 0)) for one in engines.values())] for kind in kinds]
    yield from table("Failures", ("type", *engines), counts)
    pairs = [
        [
            f"{escape(pair['first'])} and {escape(pair['second'])}",
            f"{pair['agree']:.1%}",
            "" if pair["kappa"] is None else f"{pair['kappa']:.2f}",
            f"{pair['only_first']} and {pair['only_second']}",
            f"{pair['p']:.3f}",
        ]
        for pair in told["agreement"]
        if pair["seeds"]
    ]
    yield from table("Agreement, seed by seed", ("engines", "same outcome", "kappa", "one alone", "p"), pairs)
    films = [[escape(name), "".join(map(_film, paths))] for name, paths in told.get("videos", {}).items() if paths]
    yield from table("The first successes and failures", ("engine", ""), films)


def _film(path: str) -> str:
    name = escape(Path(path).stem)
    return f'<figure><img src="{escape(path)}" alt="{name}"/><figcaption>{name}</figcaption></figure>'


def drawn(share: float | None, interval: Sequence[float]) -> str:
    """A share with its interval as a picture."""
    if share is None:
        return ""
    low, high = (WIDTH * value for value in interval)
    middle = HEIGHT / 2
    return (
        f'<svg width="{WIDTH}" height="{HEIGHT}"><rect width="{WIDTH}" height="{HEIGHT}" fill="#eee"/>'
        f'<line x1="{low:.1f}" x2="{high:.1f}" y1="{middle}" y2="{middle}" stroke="#369" stroke-width="4"/>'
        f'<circle cx="{WIDTH * share:.1f}" cy="{middle}" r="5" fill="#136"/></svg>'
    )


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """A table under its title, cells as they are; nothing without rows."""
    if rows:
        yield f"<h2>{title}</h2><table><tr>" + "".join(f"<th>{escape(column)}</th>" for column in columns) + "</tr>"
        yield from ("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
        yield "</table>"
