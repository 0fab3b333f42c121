"""One self-contained page that a person reads from top to bottom: where engines agree, where not, what explains it."""

from html import escape
from importlib.resources import files
from itertools import combinations

from anysim_parity.drawing import interval_svg, picture_uri, plot_svg
from anysim_parity.html_summary import summary
from anysim_parity.html_tables import badge, gap_table, measure_table
from anysim_parity.report import Comparison
from anysim_parity.result import Layer, Picture
from anysim_parity.verdict import findings

_HOW_TO_READ = (
    "Each layer rests on those above it: what differs in an upper layer explains part of what differs below. Numbers "
    "beyond their tolerance are amber where an engine declares that it is off there, with how far, and red where none "
    "does: red is what to look into. This is no ranking: a tolerance says what counts as equal, not what a task needs, "
    "and an engine that is further off in one measure may be the better one for yours."
)


def page(comparison: Comparison) -> str:
    """The page as HTML that is also well-formed XML; the same bytes for the same comparison."""
    names = list(comparison.engines)
    css = files("anysim_parity").joinpath("page.css").read_text("utf-8")
    title = f"{comparison.name} on {', '.join(names)}"
    links = "".join(f'<a href="#{escape(layer.name)}">{escape(layer.name)}</a>' for layer in comparison.layers)
    body = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="soft">The same world ({escape(comparison.world)}), seeds and actions on '
        f"{_versions(comparison)}. Seed {comparison.seed}, world {comparison.world_hash[:12]}.</p>",
        f"<nav>{links}</nav>",
        *summary(comparison),
        f'<p class="soft">{_HOW_TO_READ}</p>',
    ]
    for number, layer in enumerate(comparison.layers):
        body += _section(layer, names, f"l{number}")
    return (
        "<!DOCTYPE html>\n"
        f'<html lang="en"><head><meta charset="utf-8"/><title>{escape(title)}</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
        f"<style>\n{css}</style></head>\n<body>\n" + "\n".join(body) + "\n</body></html>\n"
    )


def _versions(comparison: Comparison) -> str:
    return ", ".join(escape(f"{name} {version}") for name, version in comparison.engines.items())


def _section(layer: Layer, names: list[str], prefix: str) -> list[str]:
    found = findings(layer)
    parts = [
        f'<section><h2 id="{escape(layer.name)}">{escape(layer.name.capitalize())} {badge(found)}</h2>',
        f"<p>{escape(layer.question)}</p>",
    ]
    parts += [
        f'<p><span class="bad">took no part</span> {escape(name)}: {escape(why)}</p>'
        for name, why in layer.refused.items()
    ]
    if layer.measures:
        parts.append(measure_table(layer, names))
    if layer.gaps:
        parts.append(gap_table(layer, list(combinations(names, 2))))
    figures = [
        f"<figure>{plot_svg(plot, names, f'{prefix}p{i}')}</figure>"
        for i, plot in enumerate(layer.plots)
        if plot.series
    ]
    figures += [
        f"<figure>{interval_svg(measure, names, f'{prefix}i{i}')}</figure>"
        for i, measure in enumerate(layer.measures)
        if measure.intervals
    ]
    if figures:
        parts.append('<div class="grid">' + "\n".join(figures) + "</div>")
    for title in dict.fromkeys(picture.title for picture in layer.pictures):
        same = [picture for picture in layer.pictures if picture.title == title]
        parts.append('<div class="side">' + "\n".join(_figure(picture) for picture in same) + "</div>")
    return [*parts, "</section>"]


def _figure(picture: Picture) -> str:
    alt = escape(f"{picture.title} on {picture.engine}")
    return (
        f'<figure><img src="{picture_uri(picture)}" alt="{alt}"/>'
        f"<figcaption>{escape(picture.title)}: {escape(picture.engine)}</figcaption></figure>"
    )
