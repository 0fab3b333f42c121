"""The requirements of a package's extras, one a line, as in `extra_requirements.py plugins/learning torch sb3`."""

import sys
import tomllib
from pathlib import Path


def main() -> int:
    """Print those that are of other projects."""
    folder, *extras = sys.argv[1:]
    listed = tomllib.loads((Path(folder) / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    found = {one for extra in extras for one in listed[extra] if not one.startswith("anysim")}
    print("\n".join(sorted(found)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
