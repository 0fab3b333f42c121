"""Families in a world: refusals at their lines, what they read and push at, snapshots of any origin."""

from importlib.metadata import EntryPoint

import numpy as np
import pytest

import anysim
from anysim import registry
from anysim.engine.factory import create_simulation
from anysim.errors import CapabilityError, NameLookupError, SnapshotError, SpecError
from anysim.task.snapshot import EnvSnapshot
from tests.families.paddles import Paddle, PaddleSpec

RUN = """
engine: mujoco
physics: {dt: 0.004, control_dt: 0.02}
world:
  objects:
    ball: {source: {sphere: 0.1}, mass: 1.0}
  layout:
    ball: {position: [0.6, 0.0, 0.1]}
  families:
    it:
      kind: paddle
task:
  observations: {policy: [last_action]}
"""


@pytest.fixture(autouse=True)
def _installed(monkeypatch: pytest.MonkeyPatch) -> None:
    mine, known = EntryPoint("paddle", "tests.families.paddles:Paddle", "anysim.families"), registry.entry
    monkeypatch.setattr(
        registry, "entry", lambda kind, name: mine if (kind, name) == ("families", "paddle") else known(kind, name)
    )


def written(tmp_path, text=RUN):
    path = tmp_path / "run.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("      spede: 2.0", r"run\.yaml:12:7: world\.families\.it\.spede.*did you mean 'speed'"),
        ("      speed: -1.0", r"run\.yaml:12:14: world\.families\.it\.speed.*greater than 0"),
    ],
)
def test_parameters_are_told_at_their_lines(tmp_path, line, words):
    with pytest.raises(SpecError, match=words):
        anysim.make(written(tmp_path, RUN.replace("      kind: paddle", f"      kind: paddle\n{line}")))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("kind: paddle", "kind: rigid"), r"families\.it\.kind.*what an object is.*family: rigid"),
        (("kind: paddle", "kind: padle"), r"run\.yaml:11:13: .*no family named 'padle' is installed"),
        (("    it:\n", "    ball:\n"), r"families\.ball.*there is already a robot or an object 'ball'"),
    ],
)
def test_what_is_no_family_is_refused(tmp_path, change, words):
    with pytest.raises(SpecError, match=words):
        anysim.make(written(tmp_path, RUN.replace(*change)))


def test_two_parts_of_one_name_are_told(tmp_path, monkeypatch):
    made = Paddle.parts
    monkeypatch.setattr(Paddle, "parts", classmethod(lambda cls, name, spec: [*made(name, spec), *made(name, spec)]))
    with pytest.raises(SpecError, match=r"families\.it.*the family 'paddle' of .* makes two parts called 'it'"):
        anysim.make(written(tmp_path))


def test_what_is_not_derived_from_a_family_is_told(tmp_path, monkeypatch):
    load = registry.load
    monkeypatch.setattr(registry, "load", lambda kind, name: Stranger if kind == "families" else load(kind, name))
    with pytest.raises(SpecError, match=r"families\.it.*the family 'paddle' of .* is no Family; derive it from"):
        anysim.make(written(tmp_path))


class Stranger:
    """Has parameters, and nothing else of a family."""

    spec = PaddleSpec


def test_an_engine_without_what_it_needs_is_refused(tmp_path):
    with pytest.raises(CapabilityError, match=r"null cannot run .*family 'it' \(external wrenches\)"):
        anysim.make(written(tmp_path, RUN.replace("mujoco", "'null'")))


def test_it_pushes_at_each_physics_step_and_pulls_back(tmp_path):
    with anysim.make(written(tmp_path)) as env:
        env.reset(seed=1)
        found = []
        for _ in range(100):
            env.step(np.zeros((1, 0)))
            found.append(env.engine.get_state().body_pose[0, 0, 0])
        assert found[0] < 0.6
        assert found[-1] < 0.25
        assert env.families is not None
        facts, state = env.families.facts(0), env.families.state("it")
        phase = 2.0 * 100 * 0.02
        assert facts["it"]["phase"] == pytest.approx(phase)
        x = env.families.family("it").memory["x"][0]
        assert state.points[0, 0, 0] == pytest.approx(x + 0.2 * np.sin(phase))
        with pytest.raises(NameLookupError, match=r"no family 'at'.*families: it"):
            env.families.family("at")


def test_a_damaged_snapshot_is_refused(tmp_path):
    with anysim.make(written(tmp_path)) as env:
        env.reset(seed=1)
        family = env.families.family("it")
        family.bounds["phase"] = (0.0, 10.0)
        snapshot = env.snapshot()
        rows = {**snapshot.managers["families"], "it.phase": np.array([11.0])}
        wrong = EnvSnapshot(
            snapshot.engine,
            {**snapshot.managers, "families": rows},
            snapshot.streams,
            snapshot.task,
            snapshot.spec_hash,
        )
        with pytest.raises(SnapshotError, match=r"'it\.phase' is 11, which is not between 0 and 10"):
            env.reset_to(wrong)


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_a_wrench_of_once_is_spent_and_the_others_stay(engine):
    world = anysim.compile_world(
        {
            "world": {
                "objects": {"ball": {"source": {"sphere": 0.1}, "mass": 1.0}},
                "layout": {"ball": {"position": [0, 0, 5]}},
            }
        }
    )
    with create_simulation(engine) as simulation:
        simulation.create_world(world)
        speed = []
        simulation.apply_wrench([[[1.0, 0, 0, 0, 0, 0]]], [0])
        for push in (2.0, 0.0):
            if push:
                simulation.apply_wrench([[[push, 0, 0, 0, 0, 0]]], [0], once=True)
            simulation.step(1, keep_wrench=True)
            speed.append(simulation.get_state().body_twist[0, 0, 0])
        simulation.step(1)
        simulation.step(1)
        speed.append(simulation.get_state().body_twist[0, 0, 0])
    np.testing.assert_allclose(np.array(speed) / 0.002, [3.0, 4.0, 5.0], rtol=1e-5)
