"""The tables of what importers read, from themselves, into docs/importing.md.

    python scripts/importing_table.py [--check]

`--check` writes nothing and exits with 1 if the page has drifted from the code.
"""

import sys
from collections.abc import Iterable

from generated import main

from anysim_mujoco.mjcf import coverage as mjcf
from anysim_urdf import coverage as urdf


def table(rows: Iterable[tuple[str, str, str, str]]) -> str:
    """Rows of elements, their attributes, what becomes of them and how, as a table; empty attributes: all of them."""
    lines = ["| element | attributes | | how, or why |", "|---|---|---|---|"]
    for elements, attributes, fate, text in rows:
        named = " ".join(f"`{word}`" for word in elements.split())
        given = ", ".join(f"`{word}`" for word in attributes.split())
        lines.append(f"| {named} | {given} | {fate} | {text} |")
    return "\n".join(lines)


if __name__ == "__main__":
    tables = {"URDF": urdf.rows, "MJCF": mjcf.rows}
    codes = [
        main(__doc__, name, "importing_table.py", ("docs/importing.md",), lambda rows=rows: table(rows()))
        for name, rows in tables.items()
    ]
    sys.exit(max(codes))
