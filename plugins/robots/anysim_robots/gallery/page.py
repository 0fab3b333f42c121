"""The gallery as one HTML page beside its pictures, and contact sheets of each category."""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from anysim.errors import listing
from anysim_robots.gallery.store import Stored, results
from anysim_robots.qualify.result import Qualification

WORDS: Mapping[str, str] = {"qualified": "good", "failed": "bad", "absent": "soft", "refused": "bad"}
CSS = """
body{font:15px/1.45 system-ui,sans-serif;margin:2rem auto;max-width:76rem;padding:0 1rem;color-scheme:light dark}
.robots{display:grid;grid-template-columns:repeat(auto-fill,minmax(22rem,1fr));gap:1rem}
article{border:1px solid #8886;border-radius:.5rem;padding:.7rem}
h3{margin:.1rem 0}.soft{opacity:.7}.good{color:#1a8f4c}.bad{color:#d0342c}
.side{display:flex;gap:.3rem}.side figure{margin:0;flex:1;min-width:0}.side img{width:100%;border-radius:.3rem}
figcaption{font-size:.8rem}details{font-size:.85rem}nav a{margin-right:.8rem}
"""
SHEET_BYTES = 1_000_000
"""A contact sheet is smaller than this."""


def page(stored: Stored, engines: Sequence[str], folder: Path) -> str:
    """HTML that is also well-formed XML; pictures are named relative to the folder, nothing comes from a network."""
    rows = stored["robots"]
    categories = _categories(rows)
    passed = sum(r.status == "qualified" for row in rows.values() for r in results(row).values())
    total = sum(len(row["engines"]) for row in rows.values())
    body = [
        "<h1>Robots</h1>",
        f'<p class="soft">{len(rows)} robots; {passed} of {total} pairs of robot and engine pass every check.</p>',
        "<nav>" + "".join(f'<a href="#{c}">{escape(c)}</a>' for c in categories) + "</nav>",
    ]
    for category, names in categories.items():
        body.append(f'<section><h2 id="{category}">{escape(category)}</h2><div class="robots">')
        body += [_card(name, rows[name], engines, folder) for name in names]
        body.append("</div></section>")
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/><title>Robots</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
        f"<style>{CSS}</style></head>\n<body>\n" + "\n".join(body) + "\n</body></html>\n"
    )


def _categories(rows: Mapping[str, Any]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for name in sorted(rows, key=lambda name: (rows[name].get("category", "unreadable"), name)):
        found.setdefault(rows[name].get("category", "unreadable"), []).append(name)
    return found


def _card(name: str, row: Mapping[str, Any], engines: Sequence[str], folder: Path) -> str:
    if "unreadable" in row:
        return f'<article><h3>{escape(name)}</h3><p class="bad">{escape(row["unreadable"])}</p></article>'
    found = results(row)
    facts = next((one.facts for one in found.values() if one.facts is not None), None)
    size = "" if facts is None else f"{facts.mass:.4g} kg, {facts.joints} joints, {facts.drives} driven; "
    figures = "".join(_figure(name, engine, found.get(engine), row, folder) for engine in engines)
    return (
        f"<article><h3>{escape(name)}</h3><div>{escape(row['description'])}</div>"
        f'<div class="soft">{escape(size)}{escape(row["license"])}</div>'
        f'<div class="side">{figures}</div>{_details(found)}</article>'
    )


def _figure(name: str, engine: str, found: Qualification | None, row: Mapping[str, Any], folder: Path) -> str:
    file = folder / "pictures" / f"{name}-{engine}.png"
    alt = escape(f"{name} on {engine}")
    image = (
        f'<img src="pictures/{file.name}" alt="{alt}"/>'
        if file.is_file()
        else f"<div>{escape(row.get('undrawn', {}).get(engine) or 'no picture')}</div>"
    )
    verdict = "not measured" if found is None else found.status
    word = "soft" if found is None else WORDS[found.status]
    return f'<figure>{image}<figcaption>{escape(engine)}: <span class="{word}">{verdict}</span></figcaption></figure>'


def _details(found: Mapping[str, Qualification]) -> str:
    lines = []
    for engine, one in found.items():
        told = [check.told for check in one.checks] or [one.why]
        items = "".join(f"<li>{escape(words)}</li>" for words in told)
        lines.append(f"<div>{escape(engine)} {escape(one.engine_version)}</div><ul>{items}</ul>")
    failed = listing([f"{c.name} on {e}" for e, one in found.items() for c in one.failed], 6)
    summary = f'<span class="bad">{escape(failed)}</span>' if any(one.failed for one in found.values()) else "checks"
    return f"<details><summary>{summary}</summary>{''.join(lines)}</details>"


def contact_sheets(stored: Stored, engines: Sequence[str], folder: Path, width: int = 220) -> list[Path]:
    """A PNG for each category: a row for each robot, a column for each engine, with names; each below a megabyte."""
    written: list[Path] = []
    for category, names in _categories(stored["robots"]).items():
        shown = [n for n in names if any((folder / "pictures" / f"{n}-{e}.png").is_file() for e in engines)]
        if not shown:
            continue
        target, across = folder / f"{category}.png", width
        while True:
            _sheet(shown, engines, folder, across).save(target, optimize=True)
            if target.stat().st_size < SHEET_BYTES or across < 60:
                break
            across = int(across * 0.85)
        written.append(target)
    return written


def _sheet(names: Sequence[str], engines: Sequence[str], folder: Path, width: int) -> Any:
    """Rows of robots, two robots side by side where there are many."""
    from PIL import Image, ImageDraw

    beside = 1 if len(names) <= 4 else 2
    title, count = 16, len(engines)
    down = -(-len(names) // beside)
    sheet = Image.new("RGB", (beside * count * width, down * (width + title)), "white")
    pen = ImageDraw.Draw(sheet)
    for number, name in enumerate(names):
        left, top = (number // down) * count * width, (number % down) * (width + title)
        for column, engine in enumerate(engines):
            file = folder / "pictures" / f"{name}-{engine}.png"
            pen.text((left + column * width + 3, top + 2), f"{name}, {engine}", fill="black")
            if file.is_file():
                with Image.open(file) as picture:
                    sheet.paste(picture.convert("RGB").resize((width, width)), (left + column * width, top + title))
            else:
                pen.text((left + column * width + 3, top + title + 10), "no picture", fill="gray")
    levels = np.asarray(sheet)
    return sheet if levels.size == 0 else sheet.quantize(128)
