"""The tables of what importers read, from themselves, and of models that were tried, into docs/importing.md.

    python scripts/importing_table.py [--check]

The figures of the models are those of docs/models.json and docs/model_contacts.json, which `python
benchmarks/models.py FOLDER... --json` and `python benchmarks/model_contacts.py FOLDER... --json` write, those of drafts
of docs/drafts.json, which `python benchmarks/drafts.py` writes, those of round trips of docs/usd_round_trip.json, which
`python benchmarks/usd_round_trip.py --json` writes. `--check` writes nothing and exits with 1 if the page
has drifted from the code.
"""

import json
import sys
from collections.abc import Callable, Iterable
from typing import Any

from generated import ROOT, main

from anysim_mujoco.mjcf import coverage as mjcf
from anysim_urdf import coverage as urdf, sdf_coverage as sdf
from anysim_usd import coverage as usd

ENGINES = ("mujoco", "pybullet", "sapien")


def table(rows: Iterable[tuple[str, str, str, str]]) -> str:
    """Rows of elements, their attributes, what becomes of them and how, as a table; empty attributes: all of them."""
    lines = ["| element | attributes | | how, or why |", "|---|---|---|---|"]
    for elements, attributes, fate, text in rows:
        named = " ".join(f"`{word}`" for word in elements.split())
        given = ", ".join(f"`{word}`" for word in attributes.split())
        lines.append(f"| {named} | {given} | {fate} | {text} |")
    return "\n".join(lines)


def models() -> str:
    """The models that were tried: largest differences from MuJoCo's own reading, and from its motion."""
    lines = ["| file | of | joints | springs | parameters | motion | what acts in the file alone |", "|---" * 7 + "|"]
    for row in json.loads((ROOT / "docs/models.json").read_text("utf-8")):
        if row["refused"]:
            lines.append(f"| `{row['model']}` | {row['source']} | refused: {row['refused'].splitlines()[0]} | | | | |")
            continue
        worst = max(row[key] for key in ("mass", "inertia", "limits", "passive"))
        figures = f"{row['joints']} | {row['springs']} | {worst:.0e} | {row['motion']:.0e}"
        lines.append(f"| `{row['model']}` | {row['source']} | {figures} | {row['alone']} |")
    return "\n".join(lines)


def contacts() -> str:
    """The same files as whole scenes in contact: largest differences of each engine from MuJoCo itself."""
    lines = ["| file | of | steps in contact | MuJoCo | PyBullet | SAPIEN | left out |", "|---" * 7 + "|"]
    for row in json.loads((ROOT / "docs/model_contacts.json").read_text("utf-8")):
        others = [_figure(row["others"].get(engine)) for engine in ENGINES[1:]]
        out = "; ".join(f"`{tree}`" if tree else why for tree, why in row["refused"].items())
        figures = " | ".join([str(row["touching"]), _figure(row["mujoco"]), *others])
        lines.append(f"| `{row['model']}` | {row['source']} | {figures} | {out} |")
    return "\n".join(lines)


def _figure(value: float | str | None) -> str:
    """A difference, or why an engine refuses the world."""
    if isinstance(value, str):
        return "refused: " + value.partition(". Choose another engine")[0].partition("cannot run 'world': ")[2]
    return "" if value is None else f"{value:.0e}"


def drafts() -> str:
    """The robots of packages that were drafted: how many of each package import, build, pass the audit and hold."""
    stored = json.loads((ROOT / "docs/drafts.json").read_text("utf-8"))
    by_package: dict[str, list[dict[str, Any]]] = {}
    for uri, row in stored["files"].items():
        by_package.setdefault(package_of(uri), []).append(row)
    columns = [f"{engine}: {what}" for engine in ENGINES for what in ("built", "audited", "held")]
    lines = ["| package | files | imported | tried | " + " | ".join(columns) + " |", "|---" * (4 + len(columns)) + "|"]
    for package, rows in sorted(by_package.items()):
        read = [row for row in rows if "refused" not in row]
        tried = [row for row in read if all(engine in row["engines"] for engine in ENGINES)]
        passed = [
            sum(check in row["engines"][engine].get("passed", ()) for row in tried)
            for engine in ENGINES
            for check in ("build", "audit", "hold")
        ]
        version = stored["versions"].get(package, "")
        cells = [f"{package} {version}".strip(), len(rows), len(read), len(tried), *passed]
        lines.append(f"| {' | '.join(map(str, cells))} |")
    lines += ["", "Refused, with the reason:", "", "| file | why |", "|---|---|"]
    lines += [f"| `{u}` | {cell(row['refused'])} |" for u, row in stored["files"].items() if "refused" in row]
    lines += ["", "Imported, and something did not pass:", "", "| file | engine | what, and why |", "|---|---|---|"]
    for uri, row in stored["files"].items():
        lines += [f"| `{uri}` | {engines} | {why} |" for why, engines in _failed(row).items()]
    return "\n".join(lines)


def round_trips() -> str:
    """The robots that were written as USD and read again: the largest differences of each kind, over all of them."""
    rows = json.loads((ROOT / "docs/usd_round_trip.json").read_text("utf-8"))
    kinds = list(rows[0]["exact"])
    lines = [f"| {len(rows)} robots | " + " | ".join(kinds) + " |", "|---" * (1 + len(kinds)) + "|"]
    for what, words in (("exact", "as anysim reads them"), ("plain", "by the attributes of others alone")):
        lines.append(
            f"| {words} | " + " | ".join(f"{max(row[what][kind] for row in rows):.0e}" for kind in kinds) + " |"
        )
    return "\n".join(lines)


def package_of(uri: str) -> str:
    """The distribution that a file of the drafts comes with."""
    scheme, _, rest = uri.partition(":")
    return scheme if scheme != "package" else rest.partition("/")[0].removesuffix("_data")


def _failed(row: dict[str, Any]) -> dict[str, str]:
    """By reason the engines that have it, with how far it moved [rad, m] or its frames are off [m]."""
    found: dict[str, list[str]] = {}
    for engine, one in row.get("engines", {}).items():
        for check, why in one["why"].items():
            figure = one.get({"hold": "moved", "kinematics": "frames"}.get(check, ""))
            found.setdefault(f"**{check}**: {cell(why)}", []).append(
                engine if figure is None else f"{engine} {figure:g}"
            )
    return {why: ", ".join(engines) for why, engines in found.items()}


def cell(words: str, longest: int = 200) -> str:
    """Words that do not break a table."""
    line = " ".join(words.split()).replace("|", "/").replace("<", "&lt;")
    return line if len(line) <= longest else f"{line[: longest - 1]}…"


if __name__ == "__main__":
    tables = {"URDF": urdf.rows, "SDF": sdf.rows, "MJCF": mjcf.rows, "USD": usd.rows}
    contents: dict[str, Callable[[], str]] = {name: lambda rows=rows: table(rows()) for name, rows in tables.items()}
    contents |= {"models": models, "contacts": contacts, "drafts": drafts, "round-trips": round_trips}
    page = ("docs/importing.md",)
    sys.exit(max(main(__doc__, name, "importing_table.py", page, content) for name, content in contents.items()))
