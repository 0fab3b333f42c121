"""Tables of the page: measures by engine, and gaps by pair."""

from collections.abc import Iterable, Sequence
from html import escape

from anysim_parity.result import Gap, Layer, Measure
from anysim_parity.verdict import Finding, declares


def number(value: float) -> str:
    """Four digits, which is more than any tolerance here needs."""
    text = f"{value:.4g}"
    return text.replace("e-0", "e-").replace("e+0", "e+")


def badge(found: Sequence[Finding]) -> str:
    """How many comparisons agree; how many differ as declared (amber), and how many as no engine declares (red)."""
    if not found:
        return ""
    off = [f for f in found if not f.agree]
    if not off:
        return f'<span class="good">agree ({len(found)})</span>'
    known = sum(f.declared for f in off)
    parts = [("bad", len(off) - known, "not declared"), ("known", known, "as declared")]
    return " ".join(
        f'<span class="{kind}">{count} of {len(found)} differ, {words}</span>' for kind, count, words in parts if count
    )


def measure_table(layer: Layer, engines: Sequence[str]) -> str:
    """One row a measure; numbers beyond the tolerance are marked.

    What explains a number stands below the table, once for all that it explains.
    """
    heads = ["measure", "unit", *engines, "answer", "tolerance"]
    notes = list(dict.fromkeys(m.explanation for m in layer.measures if m.explanation))
    rows = [_measure_row(measure, engines, notes) for measure in layer.measures]
    told = "".join(f"<li>{escape(note)}</li>" for note in notes)
    return table(heads, rows, range(2, 4 + len(engines))) + (f'<ol class="notes">{told}</ol>' if told else "")


def _measure_row(measure: Measure, engines: Sequence[str], notes: Sequence[str]) -> str:
    cells = []
    for name in engines:
        value = measure.values.get(name)
        if value is None:
            cells.append('<td class="n"></td>')
            continue
        away = measure.reference is not None and measure.tolerance is not None
        off = away and abs(value - measure.reference) > measure.tolerance  # pyright: ignore[reportOperatorIssue]
        classes = _classes(bool(off), measure.explanation, name)
        text = number(value)
        if name in measure.intervals:
            low, high = measure.intervals[name]
            text += f" ({number(low)} to {number(high)})"
        cells.append(f'<td class="{classes}">{text}</td>')
    answer = "" if measure.reference is None else number(measure.reference)
    tolerance = "overlap" if measure.intervals else "" if measure.tolerance is None else number(measure.tolerance)
    note = f" <sup>{notes.index(measure.explanation) + 1}</sup>" if measure.explanation else ""
    return (
        f'<tr><th scope="row">{escape(measure.subject)}{note}</th><td>{escape(measure.unit)}</td>{"".join(cells)}'
        f'<td class="n">{answer}</td><td class="n">{tolerance}</td></tr>'
    )


def _classes(off: bool, explanation: str, *engines: str) -> str:
    """Of a cell with a number: beyond its tolerance as one of the engines declares, or as none does."""
    return "n" if not off else "n known" if declares(explanation, *engines) else "n off"


def gap_table(layer: Layer, pairs: Sequence[tuple[str, str]]) -> str:
    """One row a subject, one column a pair of engines."""
    subjects = list(dict.fromkeys((gap.subject, gap.unit) for gap in layer.gaps))
    shown = [pair for pair in pairs if any({g.first, g.second} == set(pair) for g in layer.gaps)]
    rows = []
    for subject, unit in subjects:
        own = [gap for gap in layer.gaps if (gap.subject, gap.unit) == (subject, unit)]
        cells = "".join(_gap_cell(own, pair) for pair in shown)
        tolerance = next((number(gap.tolerance) for gap in own if gap.tolerance is not None), "")
        rows.append(
            f'<tr><th scope="row">{escape(subject)}</th><td>{escape(unit)}</td>{cells}'
            f'<td class="n">{tolerance}</td></tr>'
        )
    heads = ["between two engines", "unit", *(f"{a} / {b}" for a, b in shown), "tolerance"]
    return table(heads, rows, range(2, 3 + len(shown)))


def _gap_cell(gaps: Iterable[Gap], pair: tuple[str, str]) -> str:
    gap = next((g for g in gaps if {g.first, g.second} == set(pair)), None)
    if gap is None:
        return '<td class="n"></td>'
    off = gap.tolerance is not None and gap.value > gap.tolerance
    return f'<td class="{_classes(off, gap.explanation, *pair)}">{number(gap.value)}</td>'


def table(heads: Sequence[str], rows: Sequence[str], right: range) -> str:
    """A table with a head; columns in `right` hold numbers."""
    kinds = [' class="n"' if i in right else "" for i in range(len(heads))]
    head = "".join(f'<th scope="col"{kind}>{escape(text)}</th>' for kind, text in zip(kinds, heads, strict=True))
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>' + "\n".join(rows) + "</tbody></table></div>"
    )
