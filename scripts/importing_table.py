"""The tables of what importers read, from themselves, and of models that were tried, into docs/importing.md.

    python scripts/importing_table.py [--check]

The figures of the models are those of docs/models.json and docs/model_contacts.json, which `python
benchmarks/models.py FOLDER... --json` and `python benchmarks/model_contacts.py FOLDER... --json` write.
`--check` writes nothing and exits with 1 if the page has drifted from the code.
"""

import json
import sys
from collections.abc import Callable, Iterable

from generated import ROOT, main

from anysim_mujoco.mjcf import coverage as mjcf
from anysim_urdf import coverage as urdf, sdf_coverage as sdf


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
        others = [_figure(row["others"].get(engine)) for engine in ("pybullet", "sapien")]
        out = "; ".join(f"`{tree}`" if tree else why for tree, why in row["refused"].items())
        figures = " | ".join([str(row["touching"]), _figure(row["mujoco"]), *others])
        lines.append(f"| `{row['model']}` | {row['source']} | {figures} | {out} |")
    return "\n".join(lines)


def _figure(value: float | str | None) -> str:
    """A difference, or why an engine refuses the world."""
    if isinstance(value, str):
        return "refused: " + value.partition(". Choose another engine")[0].partition("cannot run 'world': ")[2]
    return "" if value is None else f"{value:.0e}"


if __name__ == "__main__":
    tables = {"URDF": urdf.rows, "SDF": sdf.rows, "MJCF": mjcf.rows}
    contents: dict[str, Callable[[], str]] = {name: lambda rows=rows: table(rows()) for name, rows in tables.items()}
    contents["models"] = models
    contents["contacts"] = contacts
    page = ("docs/importing.md",)
    sys.exit(max(main(__doc__, name, "importing_table.py", page, content) for name, content in contents.items()))
