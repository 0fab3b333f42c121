"""Which bodies of an MJCF file collide, what its chains of joints weigh, and which frame a name stands for."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from anysim.assets.model import ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation, runnable
from anysim.model.frames import find_frame
from anysim.model.world import EntityKind, World
from anysim_mujoco.mjcf.load import import_mjcf
from tests.tiers import often

Load = Callable[[str], ImportedModel]

HIP = """<mujoco><worldbody><body name="torso" pos="0 0 2"><freejoint/>
  <geom name="trunk" type="box" size="0.1 0.1 0.2" mass="8"/>
  <body name="thigh" pos="0 0 -0.2">
    <joint name="x" axis="1 0 0" range="-30 30" damping="1"/><joint name="y" axis="0 1 0" range="-30 30" damping="1"/>
    <joint name="z" axis="0 0 1" range="-30 30" damping="1"/>
    <geom name="bone" type="capsule" size="0.06" fromto="0 0 0.05 0 0 -0.4" mass="4"/>
    <body name="shin" pos="0 0 -0.4"><joint name="knee" axis="0 1 0" range="-90 0" damping="1"/>
      <geom type="capsule" size="0.05" fromto="0 0 0.05 0 0 -0.4" mass="2"/></body>
  </body></body></worldbody></mujoco>"""

LUMPED = """<mujoco><worldbody><body name="base">
  <geom name="foot" type="box" size="0.1 0.1 0.1" {foot}/>
  <body name="cover" pos="0 0 1"><geom name="lid" type="box" size="0.1 0.1 0.1"/></body>
  <body name="arm" pos="0 0 0.2"><joint name="a"/><geom name="rod" type="box" size="0.02 0.02 0.02"/>
    <body name="hand" pos="{hand}"><joint name="b"/><geom name="fist" type="box" size="0.05 0.05 0.05"/></body>
  </body></body></worldbody>
  <contact><exclude body1="base" body2="hand"/></contact></mujoco>"""


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Load:
    """`load(text)`: the text as a file, imported; the cache is private."""
    monkeypatch.setenv("ANYSIM_CACHE_DIR", str(tmp_path / "cache"))

    def read(text: str) -> ImportedModel:
        path = tmp_path / "model.xml"
        path.write_text(text, encoding="utf-8")
        return import_mjcf(path, root=tmp_path)

    return read


def words(model: ImportedModel) -> str:
    return "\n".join(str(note) for note in model.report)


def world_of(model: ImportedModel) -> World:
    builder = WorldBuilder(World("imported"))
    builder.add("it", EntityKind.OBJECT, model, root=model.bodies[0].kind, position=(0.0, 0.0, 2.0))
    return builder.build()


def test_a_body_with_several_joints_does_not_collide_with_its_parent(load: Load) -> None:
    """The extra links are between them; to the file they are neighbours."""
    model = load(HIP)
    assert [b.name for b in model.bodies] == ["torso", "thigh.x", "thigh.y", "thigh", "shin"]
    assert model.excluded_pairs == {(0, 3)}


@pytest.mark.parametrize("engine", often(["mujoco", "null"], runnable()))
def test_it_stays_whole_on_every_engine(load: Load, engine: str) -> None:
    """Shapes overlap at the hip by 5 cm: pushed apart they would turn at hundreds of radians a second."""
    simulation: SimEngine = create_simulation(engine)
    try:
        simulation.create_world(world_of(load(HIP)), 1)
        simulation.step(100)
        state = simulation.get_state()
        assert np.isfinite(state.body_pose).all()
        assert np.abs(state.joint_vel).max() < 0.5  # in free fall nothing turns
    finally:
        simulation.destroy()


@pytest.mark.parametrize("scale", [0.01, 1.0, 10.0])
def test_extra_links_take_a_millionth_of_their_body(load: Load, tmp_path: Path, scale: float) -> None:
    """Or a thousandth, of bodies so small that a millionth is nothing; the whole weighs what the file says."""
    load(HIP)
    model = import_mjcf(tmp_path / "model.xml", root=tmp_path, scale=scale)
    share = 1e-6 if scale >= 1 else 1e-3
    mass = np.array([b.inertial.mass for b in model.bodies]) / scale**3
    np.testing.assert_allclose(mass, [8, 4 * share, 4 * share, 4 - 8 * share, 2], rtol=1e-12)
    inertia = np.array([b.inertial.inertia for b in model.bodies]) / scale**5
    np.testing.assert_allclose(inertia[1] * (1 / share - 2), inertia[3], rtol=1e-9)
    assert model.bodies[1].inertial.com == pytest.approx(model.bodies[3].inertial.com)
    assert f"stands for one of the joints of 'thigh', and takes {share:g} of its mass" in words(model)


@pytest.mark.parametrize(("hand", "apart"), [("0.5 0 0", frozenset()), ("0 0 -0.15", {(0, 2)})])
def test_an_exclusion_does_not_spread_to_what_is_fixed_to_the_body(load: Load, hand: str, apart: object) -> None:
    """The fist may touch the lid: the pair is kept apart only where the excluded shapes overlap, and it is said."""
    model = load(LUMPED.format(hand=hand, foot=""))
    assert model.excluded_pairs == apart
    how = "now none does" if apart else "now all do"
    assert f"'base, cover' and 'hand': 1 of 2 pairs of their shapes do not collide in the file; {how}" in words(model)


def test_an_exclusion_of_all_there_is_holds_in_silence(load: Load) -> None:
    model = load(LUMPED.format(hand="0.5 0 0", foot="").replace('<geom name="lid" type="box" size="0.1 0.1 0.1"/>', ""))
    assert model.excluded_pairs == {(0, 2)}
    assert "pairs of their shapes" not in words(model)


def test_masks_of_some_shapes_are_said(load: Load) -> None:
    text = LUMPED.format(hand="0.5 0 0", foot='contype="2" conaffinity="2"')
    model = load(text.replace('<contact><exclude body1="base" body2="hand"/></contact>', ""))
    assert model.excluded_pairs == frozenset()
    assert "1 of 2 pairs of their shapes do not collide in the file; now all do" in words(model)


def test_a_site_that_is_called_like_a_body_does_not_hide_it(load: Load) -> None:
    """The site lies 0.25 m from its body; both are found, also where the body is lumped into another."""
    model = load("""<mujoco><worldbody><body name="arm"><freejoint/><geom size=".1"/>
      <site name="arm" pos="0.25 0 0"/><site name="tip" pos="0 0.25 0"/>
      <body name="hand" pos="0 0 1"><geom size=".1"/><site name="hand" pos="0.25 0 0"/><site name="arm.arm"/></body>
      </body></worldbody></mujoco>""")
    world = world_of(model)
    assert find_frame(world, "it.arm").position == (0.0, 0.0, 0.0)
    assert find_frame(world, "it.hand").position == (0.0, 0.0, 1.0)
    assert find_frame(world, "it.hand.hand").position == (0.25, 0.0, 1.0)
    assert model.frames["arm"].position == (0.0, 0.0, 0.0)
    names = [site.name for site in model.sites]
    assert len(set(names)) == len(names) == 5
    assert "site 'arm': is found as 'arm.arm': a body has its name (info)" in words(model)


def test_what_has_no_name_takes_none_that_is_taken(load: Load) -> None:
    model = load("""<mujoco><worldbody><body name="base"><joint name="joint1"/><geom size=".1"/>
      <body><joint/><geom size=".1"/></body><body name="body2"><joint axis="0 1 0"/><geom size=".1"/></body>
      </body></worldbody></mujoco>""")
    assert [b.name for b in model.bodies] == ["base_1", "base", "body2_1", "body2"]
    assert [j.name for j in model.joints] == ["joint1", "joint1_1", "joint2"]
    assert model.links == {"base": 1, "body2_1": 2, "body2": 3}
