"""A picture of pairs: how far apart their states are at each control step, and from which on they count as apart."""

from collections.abc import Sequence
from html import escape
from math import ceil, floor, log10
from typing import NamedTuple

from anysim.conventions import Array

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 720, 400, 64, 130, 36, 44
FLOOR = 1e-16
"""Differences that are smaller are drawn here: a logarithm has no zero."""
COLORS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22", "#17becf")


class Gap(NamedTuple):
    """A pair: its number, the largest difference (F,) at each control step, and the step that is marked, if any."""

    episode: int
    gap: Array
    diverges: int | None


def divergence_picture(title: str, gaps: Sequence[Gap], tolerance: float) -> str:
    """An SVG file with a line for each pair, a ring where it diverges, and the tolerance."""
    longest = max([len(one.gap) - 1 for one in gaps] + [1])
    largest = max([float(one.gap.max(initial=FLOOR)) for one in gaps] + [tolerance, 10 * FLOOR])
    low, high = floor(log10(FLOOR)), ceil(log10(largest))

    def x(step: float) -> float:
        return round(LEFT + (WIDTH - LEFT - RIGHT) * step / longest, 2)

    def y(value: float) -> float:
        return round(TOP + (HEIGHT - TOP - BOTTOM) * (high - log10(max(value, FLOOR))) / (high - low), 2)

    text = '<text x="{}" y="{}" text-anchor="{}">{}</text>'
    rows = [text.format(LEFT, 20, "start", escape(title))]
    for decade in range(low, high + 1, 4):
        at = y(10.0**decade)
        rows.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{at}" y2="{at}" stroke="#ddd"/>')
        rows.append(text.format(LEFT - 6, at + 4, "end", f"1e{decade}" if 10.0**decade > FLOOR else "0"))
    for part in range(5):
        step = round(longest * part / 4)
        rows.append(text.format(x(step), HEIGHT - BOTTOM + 18, "middle", step))
    middle = (LEFT + WIDTH - RIGHT) / 2
    rows.append(text.format(middle, HEIGHT - 8, "middle", "control step; largest difference in m, rad, m/s, rad/s"))
    if tolerance > 0:
        at = y(tolerance)
        rows.append(
            f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{at}" y2="{at}" stroke="#555" stroke-dasharray="5 4"/>'
        )
    for number, one in enumerate(gaps):
        color = COLORS[number % len(COLORS)]
        points = " ".join(f"{x(step)},{y(float(value))}" for step, value in enumerate(one.gap))
        rows.append(f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="1.5"/>')
        if one.diverges is not None:
            cx, cy = x(one.diverges), y(float(one.gap[one.diverges]))
            rows.append(f'<circle cx="{cx}" cy="{cy}" r="5" fill="none" stroke="{color}" stroke-width="2"/>')
        if number < (HEIGHT - TOP - BOTTOM) // 16:
            since = "never" if one.diverges is None else f"step {one.diverges}"
            at = TOP + 12 + 16 * number
            rows.append(f'<text x="{WIDTH - RIGHT + 8}" y="{at}" fill="{color}">{one.episode}: {since}</text>')
    body = "\n".join(rows)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" font-family="sans-serif" '
        f'font-size="12"><rect width="100%" height="100%" fill="white"/>\n{body}\n</svg>\n'
    )
