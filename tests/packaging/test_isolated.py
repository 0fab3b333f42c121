"""Each engine alone: it keeps its contract where the other backends are not installed, and they are only missed.

An environment holds the backend, what it depends on and pytest; `null` has none at all.
"""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from anysim import registry
from anysim.testing.engines import require_engine

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("wheels")]  # built once, by one worker

BACKENDS = ("mujoco", "pybullet", "sapien")
LIBRARIES = {"mujoco": "mujoco", "pybullet": "pybullet", "sapien": "sapien"}
FIND = "import importlib.util, sys; print(*(name for name in sys.argv[1:] if importlib.util.find_spec(name)))"
SUITE_SECONDS = 2400
SOME = "test_lifecycle or test_stepping or test_filming"
"""Of the suite, all of whose modules are imported; tests/contract runs the whole of it."""


@pytest.fixture(scope="module")
def alone(environment: Callable[..., Path]) -> Callable[[str], Path]:
    """The interpreter of an environment with one engine; made once for each."""
    made: dict[str, Path] = {}

    def make(engine: str) -> Path:
        if engine not in made:
            distributions = ["anysim-inspect", *([] if engine == "null" else [f"anysim-{engine}"])]
            made[engine] = environment(*distributions, tools=("pytest",))
        return made[engine]

    return make


@pytest.mark.parametrize("engine", ["null", *BACKENDS])
def test_the_suite_passes_without_the_other_engines(engine: str, alone: Any, program: Any, tmp_path: Path) -> None:
    require_engine(engine)
    python = alone(engine)
    others = [library for name, library in LIBRARIES.items() if name != engine]
    assert program(python, "-c", FIND, *others, cwd=tmp_path).stdout.split() == []
    suite = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "--tb=short", "--pyargs", "anysim.testing", "-k", SOME)
    out = program(python, *suite, "--engine", engine, cwd=tmp_path, timeout=SUITE_SECONDS).stdout
    found = re.search(rf"anysim contract: engine {engine} \S+: (\d+) passed, (\d+) skipped", out)
    assert found, out[-4000:]
    assert int(found[1]) >= 40  # `null` has the fewest


@pytest.mark.parametrize("engine", ["null", *BACKENDS])
def test_an_absent_engine_costs_its_own_row(engine: str, alone: Any, program: Any, tmp_path: Path) -> None:
    """`list` and `doctor` know what is here and what could be; choosing what is not says where to get it."""
    require_engine(engine)
    anysim = alone(engine).with_name("anysim")
    rows = json.loads(program(anysim, "list", "engines", "--json", cwd=tmp_path).stdout)
    assert [row["name"] for row in rows] == sorted({engine, "null"})
    done = program(anysim, "doctor", "--json", cwd=tmp_path, ok=False)
    assert done.returncode == (1 if engine == "null" else 0), "doctor fails where no engine with dynamics works"
    states = {row["what"]: row for row in json.loads(done.stdout)}
    assert states[f"engine: {engine}"]["state"] == "ok"
    (tmp_path / "empty.yaml").write_text("world: {terrain: none}\n")
    for absent in (name for name in BACKENDS if name != engine):
        package = registry.INSTALL_HINTS["engines", absent]
        assert states[f"engine: {absent}"]["state"] == "missing"
        assert states[f"engine: {absent}"]["remedy"] == f"pip install {package}"
        chosen = program(anysim, "check", "empty.yaml", "--engine", absent, cwd=tmp_path, ok=False)
        assert chosen.returncode == 1
        assert f"it comes with the package {package}: pip install {package}" in chosen.stderr
        assert "Traceback" not in chosen.stderr
    assert program(anysim, "check", "empty.yaml", "--engine", engine, cwd=tmp_path).returncode == 0
