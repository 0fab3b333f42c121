"""Exact versions: writes constraints.txt with one of everything in the environment, for every Python from 3.11 on.

    python scripts/lock.py               keep the versions where the pyproject.toml files allow it
    python scripts/lock.py --upgrade     take the newest that they allow

The file holds names and versions only: no hosts, no hashes, so that it serves every mirror. `make check` says when it
no longer meets the pyproject.toml files.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from checks.constraints import FILE, PINS
from checks.tree import Tree

HEADER = "# Exact versions of the environment, written by scripts/lock.py from the members' pyproject.toml files.\n"


def find_uv(root: Path) -> str:
    """The uv that `make venv` uses: that of the PATH, else its own."""
    found = shutil.which("uv", path=os.pathsep.join([os.environ.get("PATH", ""), str(root / ".venv-tools" / "bin")]))
    if found is None:
        sys.exit("uv is not here; run `make venv`, which fetches it")
    return found


def resolve(root: Path, upgrade: bool) -> list[str]:
    """The lines of the file: what uv resolves for all members, the extras that `make venv` installs, and all groups."""
    projects = [str(member.folder / "pyproject.toml") for member in Tree.of(root).members]
    with tempfile.TemporaryDirectory() as folder:
        pins, out = Path(folder) / "pins.txt", Path(folder) / "out.txt"
        pins.write_text("".join(f"{name}=={version}\n" for name, version in PINS.items()), "utf-8")
        if (root / FILE).is_file() and not upgrade:
            shutil.copy(root / FILE, out)  # uv keeps what its output file says
        command = [
            find_uv(root), "pip", "compile", "--quiet", "--universal", "--python-version", "3.11",
            "--fork-strategy", "fewest", "--no-header", "--no-annotate", "--extra", "all", "--group", "dev",
            "--constraint", str(pins), "--output-file", str(out), *projects,
        ]  # fmt: skip
        subprocess.run(command, cwd=root, check=True, stdout=subprocess.DEVNULL)
        lines = out.read_text("utf-8").splitlines()
    kept = [line for line in lines if not line.startswith(("-e ", "#"))]  # the members are no constraint
    return sorted(kept, key=lambda line: line.partition("==")[0])


def main() -> None:
    """Resolve and write."""
    parser = argparse.ArgumentParser(description="Write constraints.txt.")
    parser.add_argument("--upgrade", action="store_true", help="take the newest versions that are allowed")
    root = Path(__file__).parents[1]
    lines = resolve(root, parser.parse_args().upgrade)
    (root / FILE).write_text(HEADER + "".join(f"{line}\n" for line in lines), "utf-8")
    print(f"{FILE}: {len(lines)} versions")


if __name__ == "__main__":
    main()
