"""The table of what can be randomised on which engine, from the engines' own declarations, into the docs.

    python scripts/axes_table.py [--check]

`--check` writes nothing and exits with 1 if the page has drifted from the code.
"""

import sys

from axes import table
from capability_table import DISTRIBUTIONS
from generated import main

from anysim import registry


def rows() -> str:
    """Axes as rows, engines as columns."""
    names = [n for n in registry.names("engines") if registry.distribution("engines", n) in DISTRIBUTIONS]
    engines = {name: registry.load("engines", name) for name in names}
    lines = [f"| what | keys | {' | '.join(engines)} |", f"|---|---|{'---|' * len(engines)}"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in table(engines))])


if __name__ == "__main__":
    sys.exit(main(__doc__, "axes", "axes_table.py", ("docs/concepts/randomisation.md",), rows))
