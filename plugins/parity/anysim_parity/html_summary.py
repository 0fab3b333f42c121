"""The top of the page: who agrees with whom in which layer, what differs, and whether that was declared."""

from collections.abc import Mapping, Sequence
from html import escape
from itertools import combinations

from anysim_parity.html_tables import badge, number, table
from anysim_parity.report import Comparison
from anysim_parity.verdict import ANALYTIC, Finding, between, disagreements, findings, worst

LISTED, SUBJECTS = 12, 6
"""Reasons that the summary tells, and measures of each; the tables have all of them."""


def summary(comparison: Comparison) -> list[str]:
    """The sections above the layers."""
    return [*_agreement(comparison), *_differences(comparison)]


def _agreement(comparison: Comparison) -> list[str]:
    names = list(comparison.engines)
    pairs = list(combinations(names, 2))
    rows = []
    for layer in comparison.layers:
        found = findings(layer)
        cells = "".join(f"<td>{_cell(between(found, a, b))}</td>" for a, b in pairs)
        cells += "".join(f"<td>{_cell(between(found, name, ANALYTIC))}</td>" for name in names)
        link = f'<a href="#{escape(layer.name)}">{escape(layer.name)}</a>'
        rows.append(f'<tr><th scope="row">{link}</th>{cells}</tr>')
    heads = ["layer", *(f"{a} / {b}" for a, b in pairs), *(f"{name} / answer" for name in names)]
    return ["<h2>In short</h2>", _sentence(comparison), table(heads, rows, range(0))]


def _sentence(comparison: Comparison) -> str:
    agree, declared, news = [], [], []
    for layer in comparison.layers:
        found = findings(layer)
        off = [f for f in found if not f.agree]
        if found:
            (agree if not off else declared if all(f.declared for f in off) else news).append(layer.name)
    parts = []
    if agree:
        parts.append(f"Within all tolerances: <b>{', '.join(agree)}</b>.")
    if declared:
        parts.append(f"Further apart only where an engine declares it: <b>{', '.join(declared)}</b>.")
    if news:
        parts.append(f"With differences that no engine declares: <b>{', '.join(news)}</b>.")
    return f"<p>{' '.join(parts) or 'Nothing could be compared.'}</p>"


def _cell(found: Sequence[Finding]) -> str:
    if not found:
        return ""
    top = worst(found)
    assert top is not None
    text = badge(found)
    if top.agree:
        return text
    return f'{text}<br/><span class="soft">{escape(top.subject)}: {number(top.gap)} {escape(top.unit)}</span>'


def _differences(comparison: Comparison) -> list[str]:
    found = disagreements(comparison.layers)
    refused = [(layer.name, name, why) for layer in comparison.layers for name, why in layer.refused.items()]
    parts: list[str] = []
    if found:
        reasons: dict[tuple[str, str], dict[str, list[Finding]]] = {}
        for f in found:
            reasons.setdefault((f.layer, f.explanation), {}).setdefault(f.subject, []).append(f)
        for title, wanted in (("What differs, and no engine declares", False), ("What differs as declared", True)):
            own = [item for item in reasons.items() if _declared(item[1]) is wanted]
            if not own:
                continue
            items = [_item(layer, why, subjects) for (layer, why), subjects in own[:LISTED]]
            more = len(own) - len(items)
            tail = f'<p class="soft">and {more} more, in the tables below</p>' if more > 0 else ""
            parts += [f"<h3>{title}</h3>", f'<ol class="why">{"".join(items)}</ol>{tail}']
    if refused:
        items = [f"<li><b>{escape(layer)}</b>, {escape(name)}: {escape(why)}</li>" for layer, name, why in refused]
        parts += ["<h3>What could not be compared</h3>", f"<ul>{''.join(items)}</ul>"]
    return parts


def _declared(subjects: Mapping[str, Sequence[Finding]]) -> bool:
    return all(f.declared for group in subjects.values() for f in group)


def _item(layer: str, why: str, subjects: Mapping[str, Sequence[Finding]]) -> str:
    """All that one reason explains."""
    told = [_told(subject, group) for subject, group in list(subjects.items())[:SUBJECTS]]
    if len(subjects) > SUBJECTS:
        told.append(f"and {len(subjects) - SUBJECTS} more")
    reason = escape(why) if why else "Nothing that is known explains it."
    return f'<li>{escape(layer)}, {"; ".join(told)}.<br/><span class="soft">{reason}</span></li>'


def _told(subject: str, group: Sequence[Finding]) -> str:
    """One subject: the engines that are off its answer, else the pairs that differ."""
    own = [f for f in group if f.second == ANALYTIC]
    if own:
        parts = [f"{f.first} {number(f.gap)} {f.unit}".rstrip() for f in own]
        text = f"{', '.join(parts)} from the answer"
    else:
        own = list(group)
        parts = [f"{f.first} and {f.second} {number(f.gap)} {f.unit}".rstrip() for f in own]
        text = f"{', '.join(parts)} apart"
    allowed = f" (tolerance {number(own[0].tolerance)})" if own[0].tolerance > 0 else ""
    return f"<b>{escape(subject)}</b>: {escape(text)}{allowed}"
