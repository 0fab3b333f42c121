"""The tables of what every parser accepts, and of the bounds of physics, from themselves, into docs/limits.md.

    python scripts/limits_table.py [--check]

`--check` writes nothing and exits with 1 if the page has drifted from the code.
"""

import sys

from generated import main

from anysim_schemas import bounds, limits

if __name__ == "__main__":
    codes = [
        main(__doc__, name, "limits_table.py", ("docs/limits.md",), content)
        for name, content in (("limits", lambda: limits.table().rstrip()), ("bounds", lambda: bounds.table().rstrip()))
    ]
    sys.exit(max(codes))
