"""Plots as SVG that stands inside a page: the same bytes for the same numbers, in the page's own colour of text."""

import base64
import re
from collections.abc import Sequence
from io import BytesIO, StringIO
from typing import Any

from anysim.errors import AnysimError
from anysim_parity.result import Measure, Picture, Plot

COLORS = ("#2f7ed8", "#e8710a", "#2a9d5c", "#b455c9", "#c9a400", "#7a6a5a")
"""Of the engines, in their order; told apart by most eyes, on white and on black."""

LINES = ("-", "--", "-.", ":")
_INK = "#123456"  # stands for the page's colour of text until the SVG is finished

_UNSIGNED: dict[Any, Any] = {"Software": None}
"""An image that does not name matplotlib's version."""

_STYLE: dict[Any, Any] = {
    "svg.hashsalt": "anysim", "svg.fonttype": "none", "font.family": "sans-serif", "font.size": 9,
    "axes.edgecolor": _INK, "axes.labelcolor": _INK, "axes.titlecolor": _INK, "text.color": _INK,
    "xtick.color": _INK, "ytick.color": _INK, "grid.color": _INK, "grid.alpha": 0.15, "axes.grid": True,
    "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False,
}  # fmt: skip

REMEDY = "pip install 'anysim[report]'"


def require_matplotlib(why: str = "the page needs matplotlib for its plots") -> None:
    """Say at once that nothing can be drawn, and what to do.

    Raises:
        AnysimError: matplotlib is not installed.
    """
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise AnysimError(f"{why}, which is not installed: {REMEDY}") from error


def plot_svg(plot: Plot, engines: Sequence[str], prefix: str) -> str:
    """Curves; `prefix` keeps the ids of several plots on a page apart."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context(_STYLE):
        figure = Figure(figsize=(5.2, 2.9), layout="constrained")
        axis = figure.subplots()
        if plot.reference is not None:
            r = plot.reference
            axis.plot(r.x, r.y, color=_INK, linewidth=1.2, alpha=0.55, label=r.name, zorder=1)
        for series in plot.series:
            place = engines.index(series.name) if series.name in engines else len(engines)
            few = len(series.x) <= 40
            axis.plot(
                series.x,
                series.y,
                color=COLORS[place % len(COLORS)],
                linestyle=LINES[place % len(LINES)],
                linewidth=1.4,
                marker="os^Dv"[place % 5] if few else None,
                markersize=3.5,
                label=series.name,
                zorder=2,
            )
        axis.set_title(plot.title, loc="left", fontsize=10)
        axis.set_xlabel(plot.x_label)
        axis.set_ylabel(plot.y_label)
        if plot.series:
            axis.legend(fontsize=8, ncols=2)
        return _inline(figure, prefix, f"{plot.title}: {plot.y_label} over {plot.x_label}, by engine")


def interval_svg(measure: Measure, engines: Sequence[str], prefix: str) -> str:
    """Estimates with their confidence intervals."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    shown = [name for name in engines if name in measure.intervals]
    with rc_context(_STYLE):
        figure = Figure(figsize=(5.2, 0.7 + 0.4 * len(shown)), layout="constrained")
        axis = figure.subplots()
        for row, name in enumerate(reversed(shown)):
            low, high = measure.intervals[name]
            color = COLORS[engines.index(name) % len(COLORS)]
            axis.plot([low, high], [row, row], color=color, linewidth=3, alpha=0.5, solid_capstyle="butt")
            axis.plot([measure.values[name]], [row], "o", color=color)
        axis.set_yticks(range(len(shown)), list(reversed(shown)))
        axis.set_ylim(-0.6, len(shown) - 0.4)
        axis.set_xlim(-0.02, 1.02)
        axis.set_title(f"{measure.subject}, with 95 % intervals", loc="left", fontsize=10)
        return _inline(figure, prefix, f"{measure.subject} by engine with 95 % confidence intervals")


def picture_uri(picture: Picture) -> str:
    """An image as a data: URI."""
    from matplotlib.image import imsave

    buffer = BytesIO()
    imsave(buffer, picture.pixels, format="png", metadata=_UNSIGNED)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()


def _inline(figure: Any, prefix: str, label: str) -> str:
    from html import escape

    text = StringIO()
    figure.savefig(text, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", svg)
    svg = svg.replace("xlink:href", "href").replace(_INK, "currentColor")
    svg = re.sub(r'\bid="([^"]+)"', rf'id="{prefix}-\1"', svg)
    svg = re.sub(r'href="#', f'href="#{prefix}-', svg)
    svg = svg.replace("url(#", f"url(#{prefix}-")
    box = re.search(r'viewBox="([^"]+)"', svg)
    assert box is not None  # matplotlib always writes one
    svg = f'<svg viewBox="{box[1]}" role="img" aria-label="{escape(label)}">' + svg[svg.index(">") + 1 :]
    return svg.strip()
