"""The table of families and engines, from their own declarations, into docs/matter.md.

    python scripts/matter_table.py [--check]

`--check` writes nothing and exits with 1 if the page has drifted from the code.
"""

import sys

from capability_table import DISTRIBUTIONS
from generated import main

from anysim import registry
from anysim.engine.capability import Capabilities, Capability
from anysim.families.base import Family
from anysim.families.cosolver import CoSolver

FAMILIES = ("anysim", "anysim-avatars", "anysim-particles", "anysim-soft")
"""The distributions of this repository that bring families."""


def table() -> str:
    """Families as rows, engines as columns: what an engine lacks of what a family needs, or of what images need."""
    engines = [n for n in registry.names("engines") if registry.distribution("engines", n) in DISTRIBUTIONS]
    made = {name: registry.load("engines", name) for name in engines}
    lines = [f"| family | moved by | {' | '.join(engines)} |", f"|---|---|{'---|' * len(engines)}"]
    for name in registry.names("families"):
        if registry.distribution("families", name) not in FAMILIES:
            continue
        kind = registry.load("families", name)
        cells = [_cell(kind, engine.capabilities) for engine in made.values()]
        lines.append(f"| `{name}` | {_mover(kind)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _mover(kind: type) -> str:
    if not issubclass(kind, Family):
        return "the engine"
    rate = "each physics step" if kind.rate == "physics" else "each part of a control step"
    return f"{'a solver of its own' if issubclass(kind, CoSolver) else 'the family'}, {rate}"


def _cell(kind: type, capabilities: Capabilities) -> str:
    needs = kind.needs if issubclass(kind, Family) else (Capability.RIGID_BODIES,)
    absent = [str(need) for need in needs if need not in capabilities]
    if absent:
        return f"refused: no {', '.join(absent)}"
    drawn = Capability.RENDER_DEPTH if issubclass(kind, Family) and kind.drawn else Capability.RENDER_RGB
    lacking = {"images": drawn, "snapshots to the bit": Capability.SNAPSHOT_TRAJECTORY}
    without = [words for words, capability in lacking.items() if capability not in capabilities]
    return f"yes, without {' and '.join(without)}" if without else "yes"


if __name__ == "__main__":
    sys.exit(main(__doc__, "families", "matter_table.py", ("docs/matter.md",), table))
