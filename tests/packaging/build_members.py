"""Builds the wheels of members, each from its source distribution, in one process: `build_members.py OUT MEMBER...`.

What `uv build --all-packages` does in two processes and two environments for each. hatchling has to be installed.
"""

import os
import sys
import tarfile
import tempfile
from pathlib import Path

from hatchling.build import build_sdist, build_wheel  # pyright: ignore[reportMissingImports] of the wheels' environment


def build(member: Path, out: Path) -> None:
    """The hooks of a build know a project by the working directory."""
    os.chdir(member)
    name = build_sdist(str(out))
    with tempfile.TemporaryDirectory() as folder:
        with tarfile.open(out / name) as archive:
            archive.extractall(folder, filter="data")
        os.chdir(Path(folder) / name.removesuffix(".tar.gz"))
        build_wheel(str(out))
        os.chdir(member)


if __name__ == "__main__":
    for one in sys.argv[2:]:
        build(Path(one), Path(sys.argv[1]))
