"""The table of what every parser accepts at most, from the limits themselves, into docs/limits.md.

    python scripts/limits_table.py [--check]

`--check` writes nothing and exits with 1 if the page has drifted from the code.
"""

import sys

from generated import main

from anysim_schemas.limits import table

if __name__ == "__main__":
    sys.exit(main(__doc__, "limits", "limits_table.py", ("docs/limits.md",), lambda: table().rstrip()))
