"""The table of families and engines, from their declarations and from what was found, into docs/matter.md.

    python scripts/matter_table.py [--check]

What was found is in docs/families.json, which `python benchmarks/families.py --write` writes. `--check` writes nothing
and exits with 1 if the page has drifted from the code or from the figures.
"""

import json
import sys
from pathlib import Path
from typing import Any

from capability_table import DISTRIBUTIONS
from generated import main

from anysim import registry
from anysim.engine.capability import Capabilities, Capability
from anysim.families.base import Family
from anysim.families.cosolver import CoSolver

FAMILIES = ("anysim", "anysim-avatars", "anysim-fields", "anysim-particles", "anysim-soft")
"""The distributions of this repository that bring families."""


ROWS = Path(__file__).parents[1] / "docs" / "families.json"
QUESTIONS = {"snapshot": "snapshot", "partial_reset": "partial reset", "replay": "replay"}
"""What is asked to the bit, by its key."""


def table() -> str:
    """Families as rows, engines as columns: what was found of each, or why it is refused."""
    engines = [n for n in registry.names("engines") if registry.distribution("engines", n) in DISTRIBUTIONS]
    made = {name: registry.load("engines", name) for name in engines}
    found: dict[str, Any] = json.loads(ROWS.read_text("utf-8"))
    lines = [f"| family | moved by | measured with | {' | '.join(engines)} |", f"|---|---|---|{'---|' * len(engines)}"]
    own = [n for n in registry.names("families") if registry.distribution("families", n) in FAMILIES]
    for name in sorted({*own, *found}):
        rows = found.get(name, {})
        size = next((row["size"] for row in rows.values()), "")
        if name not in own:
            lines.append(f"| `{name}` | | {size} |{' not installed |' * len(engines)}")
            continue
        kind = registry.load("families", name)
        cells = [_cell(kind, one.capabilities, rows.get(engine)) for engine, one in made.items()]
        lines.append(f"| `{name}` | {_mover(kind)} | {size} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _mover(kind: type) -> str:
    if not issubclass(kind, Family):
        return "the engine"
    rate = "each physics step" if kind.rate == "physics" else "each part of a control step"
    return f"{'a solver of its own' if issubclass(kind, CoSolver) else 'the family'}, {rate}"


def _cell(kind: type, capabilities: Capabilities, row: dict[str, Any] | None) -> str:
    needs = kind.needs if issubclass(kind, Family) else (Capability.RIGID_BODIES,)
    absent = [str(need) for need in needs if need not in capabilities]
    if absent:
        return f"refused: no {', '.join(absent)}"
    if row is not None:
        return _measured(kind, row)
    drawn = Capability.RENDER_DEPTH if issubclass(kind, Family) and kind.drawn else Capability.RENDER_RGB
    lacking = {"images": drawn, "snapshots to the bit": Capability.SNAPSHOT_TRAJECTORY}
    without = [words for words, capability in lacking.items() if capability not in capabilities]
    words = f", without {' and '.join(without)}" if without else ""
    return f"declared{words}; not measured"


def _measured(kind: type, row: dict[str, Any]) -> str:
    """What a run of benchmarks/families.py found on an engine, in words."""
    if row["builds"] != "yes":
        return f"does not build: {row['builds']}"
    wrong = [f"fails `{test}`" for test in row["suite"]] if isinstance(row["suite"], dict) else []
    wrong += [f"no {words} to the bit" for key, words in QUESTIONS.items() if not row[key]]
    if not row["pixels"] and (not issubclass(kind, Family) or kind.drawn or kind.rate == "control"):
        wrong.append("not seen")
    return f"{', '.join(wrong) or 'all'}; {row['ms']:.2g} ms"


if __name__ == "__main__":
    sys.exit(main(__doc__, "families", "matter_table.py", ("docs/matter.md",), table))
