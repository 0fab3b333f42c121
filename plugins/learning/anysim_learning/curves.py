"""Learning curves as a page: each number of the exams over the steps that it took, one line for each training."""

import json
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from math import ceil, isfinite, log10
from pathlib import Path

from anysim.errors import RecordError

CURVE, PAGE = "curve.jsonl", "curves.html"

Rows = Sequence[Mapping[str, float]]
"""The exams of a training, in order."""

_WIDTH, _HEIGHT, _LEFT, _BELOW = 460, 240, 64, 32
"""[px] of a picture, and of its margins for numbers."""
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000", "#999933")
"""Of Okabe and Ito: told apart by those who see few colours, too."""
_FIRST = ("exam", "success", "reward")
_APART = ("steps", "best", "cpu_s")
"""Numbers that are in the table and not drawn."""
_STYLE = """body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; } th, td { border-bottom: 1px solid #ccc; padding: 0.3rem 0.8rem; text-align: left; }
figure { display: inline-block; margin: 1rem 0.5rem 0 0; } text { font: 11px system-ui, sans-serif; }"""


def read_curve(folder: Path) -> Rows:
    """The exams of a training.

    Raises:
        RecordError: the directory is none of a training, or its file is damaged.
    """
    try:
        return [json.loads(line) for line in (folder / CURVE).read_text("utf-8").splitlines()]
    except (OSError, ValueError) as error:
        raise RecordError(
            f"{folder} has no exams: {error}; expected the directory of a training, as `anysim train` writes it"
        ) from None


def page(curves: Mapping[str, Rows], film: str = "") -> str:
    """HTML that needs no other file but the film; the same bytes for the same curves.

    Args:
        curves: exams by the name of the training.
        film: where the video of the best policy is, from the page; empty where there is none.
    """
    told = {name: rows for name, rows in curves.items() if rows}
    present = dict.fromkeys(key for rows in told.values() for row in rows for key in row if key not in _APART)
    drawn = [*(key for key in _FIRST if key in present), *(key for key in present if key not in _FIRST)]
    lines = [
        "<h1>Learning curves</h1>",
        *_table(told),
        *(_picture(key, told) for key in drawn),
        *([f'<figure><img src="{escape(film)}" alt="the best policy"/></figure>'] if film else []),
    ]
    head = f'<meta charset="utf-8"/><title>Learning curves</title><style>\n{_STYLE}</style>'
    body = "\n".join(lines)
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n<body>\n{body}\n</body></html>\n'


def _table(curves: Mapping[str, Rows]) -> Iterator[str]:
    """How far each training is, which is the key to the colours as well."""
    yield "<table><tr><th></th><th>training</th><th>steps</th><th>best exam</th><th>last</th><th>CPU s</th></tr>"
    for number, (name, rows) in enumerate(curves.items()):
        last = rows[-1]
        swatch = f'<svg width="16" height="10"><rect width="16" height="10" fill="{_colour(number)}"/></svg>'
        spent = f"{last['cpu_s']:,.0f}" if "cpu_s" in last else ""
        cells = [escape(name), f"{last['steps']:,.0f}", f"{last['best']:.0%}", f"{last['exam']:.0%}", spent]
        yield f"<tr><td>{swatch}</td>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
    yield "</table>"


def _picture(key: str, curves: Mapping[str, Rows]) -> str:
    """One number of all trainings over their steps."""
    points = [
        [(row["steps"], row[key]) for row in rows if isfinite(row.get(key, float("nan")))] for rows in curves.values()
    ]
    values = [value for line in points for _, value in line]
    shares = key in ("exam", "success")
    low, high = (0.0, 1.0) if shares else (min(values, default=0.0), max(values, default=1.0))
    right = max((steps for line in points for steps, _ in line), default=1.0)
    span = (high - low) or 1.0

    def at(steps: float, value: float) -> tuple[float, float]:
        x = _LEFT + steps / right * (_WIDTH - _LEFT - 12)
        return x, _HEIGHT - _BELOW - (value - low) / span * (_HEIGHT - _BELOW - 12)

    marks = [
        *(_across(at(0.0, value)[1], f"{value:.0%}" if shares else f"{value:.4g}") for value in _ticks(low, high)),
        *(_under(at(value, low)[0], f"{value:,.0f}") for value in _ticks(0.0, right, 3)),
    ]
    lines = [_line([at(*point) for point in line], _colour(number)) for number, line in enumerate(points)]
    drawing = "".join([*marks, *lines])
    picture = f'<svg width="{_WIDTH}" height="{_HEIGHT}">{drawing}</svg>'
    return f"<figure><figcaption>{escape(key)}</figcaption>{picture}</figure>"


def _line(points: Sequence[tuple[float, float]], colour: str) -> str:
    where = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{colour}"/>' for x, y in points)
    return f'<polyline points="{where}" fill="none" stroke="{colour}" stroke-width="1.5"/>{dots}'


def _across(y: float, label: str) -> str:
    rule = f'<line x1="{_LEFT}" x2="{_WIDTH}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>'
    return f'{rule}<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{label}</text>'


def _under(x: float, label: str) -> str:
    return f'<text x="{x:.1f}" y="{_HEIGHT - _BELOW + 18}" text-anchor="middle">{label}</text>'


def _ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Round numbers within a range, a few."""
    span = (high - low) or 1.0
    unit = 10.0 ** ceil(log10(span / most) - 1)
    step = next(unit * k for k in (1, 2, 5, 10, 20, 50) if span / (unit * k) <= most)
    first = ceil(low / step - 1e-9)
    return [k * step for k in range(first, first + most + 2) if k * step <= high + 1e-9 * span]


def _colour(number: int) -> str:
    return _COLOURS[number % len(_COLOURS)]
