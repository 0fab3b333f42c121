"""The table of engines and what each can do, from the engines' own declarations, into README.md and docs/engines.md.

    python scripts/capability_table.py [--check]

`--check` writes nothing and exits with 1 if a file has drifted from the code.
"""

import sys

from generated import main

from anysim import registry
from anysim.engine.capability import matrix

DISTRIBUTIONS = ("anysim", "anysim-mujoco", "anysim-pybullet", "anysim-sapien")
"""The engines of this repository; what else is installed on a developer's machine has no place in its README."""


def table() -> str:
    """Engines as columns, capabilities as rows; notes of approximations below."""
    names = [n for n in registry.names("engines") if registry.distribution("engines", n) in DISTRIBUTIONS]
    found = {name: registry.load("engines", name) for name in names}
    engines, rows, notes = matrix(
        {name: engine.capabilities for name, engine in found.items()},
        {name: engine.lifecycle.words for name, engine in found.items()},
    )
    lines = [f"| | {' | '.join(engines)} |", f"|---|{'---|' * len(engines)}"]
    lines += [f"| {' | '.join(row)} |" for row in rows]
    lines += ["", *(f"[{number}] {note}  " for number, note in enumerate(notes, 1))]
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main(__doc__, "engines", "capability_table.py", ("README.md", "docs/engines.md"), table))
