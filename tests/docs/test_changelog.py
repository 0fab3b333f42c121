"""The changelog's table of modules that moved: each is where it says."""

import re
from importlib.util import find_spec
from pathlib import Path

TEXT = (Path(__file__).parents[2] / "CHANGELOG.md").read_text()
ROW = re.compile(r"^\| `([\w.]+)` \| `([\w.]+)` \| (`\w+`.*) \|$", re.MULTILINE)
MODULE = re.compile(r"`(\w+)`(?: → `(\w+)`)?")


def exists(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:  # nor is its package
        return False


def test_every_new_home_exists() -> None:
    homes = {
        f"{old}.{module}": f"{new}.{renamed or module}"
        for old, new, modules in ROW.findall(TEXT)
        for module, renamed in MODULE.findall(modules)
    }
    assert len(homes) >= 200
    assert [f"{old} is said to be {new}" for old, new in homes.items() if not exists(new)] == []
