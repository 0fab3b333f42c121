"""Mocap bodies of MJCF scenes move as a program has them; paired geoms of a file are told where that matters."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from anysim.api import make
from anysim.model.world import BodyKind
from anysim_mujoco.mjcf.pairs import of_pairs

PADDLE = """<mujoco><option timestep="0.002" cone="elliptic" integrator="implicitfast"/><worldbody>
  <geom type="plane" size="4 4 .1"/>
  <body name="paddle" mocap="true" pos="0 0 .2"><geom type="box" size=".05 .3 .1"/></body>
  <body name="ball" pos=".2 .02 .0995"><freejoint/><geom size=".1" mass=".5"/></body></worldbody>
  <keyframe><key name="home" mpos="0 .01 .12"/></keyframe></mujoco>"""


def test_a_mocap_body_of_a_scene_pushes_as_in_mujoco(tmp_path: Path) -> None:
    """It is fixed, begins where the keyframe has it, and what writes its pose drives it through a ball."""
    (tmp_path / "paddle.xml").write_text(PADDLE)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "paddle.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    run = {
        "engine": {"name": "mujoco", "options": {"constraints": "mujoco"}},
        "world": {"source": str(tmp_path / "paddle.xml")},
        "physics": {"control_dt": 0.002},
        "task": {"observations": {"policy": ["last_action"]}},
    }
    with make(run) as env:
        env.reset(seed=0)
        engine = env.engine
        paddle, ball = (engine.index.entity(name).root for name in ("paddle", "ball"))
        assert engine.world.bodies[paddle].kind is BodyKind.STATIC
        assert engine.get_state().body_pose[0, paddle, :3] == pytest.approx(data.mocap_pos[0])
        for step in range(150):
            place = np.array([0.001 * step, 0.01, 0.12, 0.0, 0.0, 0.0, 1.0])
            engine.set_body_state([[place]], env_ids=[0], bodies=[paddle])
            data.mocap_pos[0] = place[:3]
            env.step([[]])
            mujoco.mj_step(model, data)
        found = engine.get_state().body_pose[0, ball, :3]
    assert data.qpos[0] > 0.25
    np.testing.assert_allclose(found, data.qpos[:3], atol=1e-9)


GEOMS = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 .1" friction=".4 .01 .02" solref=".03 1"
    solmix="2" margin=".01" {floor}/>
  <body name="a" pos="0 0 .1"><freejoint/><geom name="a" size=".1" friction=".8 .005 .03" solimp=".8 .9 .01 .5 2"
    gap=".005" margin=".02" condim="{condim}" {a}/></body></worldbody>{contact}</mujoco>"""


@pytest.mark.parametrize("condim", [1, 3, 4, 6])
@pytest.mark.parametrize("first", [{}, {"floor": 'priority="1"'}])
def test_a_pair_that_says_what_its_geoms_do_is_not_noted(condim: int, first: dict[str, str]) -> None:
    """What MuJoCo makes of two geoms, written as a pair, is nothing new; each other value of it is named."""
    parts = {"floor": "", "a": "", "contact": "", "condim": condim, **first}
    model = mujoco.MjModel.from_xml_string(GEOMS.format(**parts))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    contact = data.contact[0]
    numbers = {
        "condim": [contact.dim],
        "friction": contact.friction,
        "solref": contact.solref,
        "solimp": contact.solimp,
        "margin": [contact.includemargin],
        "gap": [0.005],
    }
    text = lambda values: " ".join(f"{v:.17g}" for v in np.ravel(values))  # noqa: E731

    def noted(**others: str) -> list[str]:
        own = {key: text(value) for key, value in numbers.items()} | others
        pair = " ".join(f'{key}="{value}"' for key, value in own.items())
        whole = {**parts, "contact": f'<contact><pair name="p" geom1="floor" geom2="a" {pair}/></contact>'}
        return [note.message for note in of_pairs(mujoco.MjModel.from_xml_string(GEOMS.format(**whole)))]

    assert noted() == []
    assert noted(margin="0.2", gap="0.1") == [
        "meet with what their two geoms have, not with the margin, gap of the pair (1: p)"
    ]
    other = "3" if contact.dim != 3 else "4"
    assert "not with the condim" in noted(condim=other)[0]
    assert ("friction" in str(noted(friction="0.1 0.1 0 0 0"))) == (contact.dim > 1)


def test_pairs_that_meet_by_themselves_alone_are_told() -> None:
    pair = '<contact><pair name="p" geom1="floor" geom2="a"/>{0}</contact>'
    for parts in (
        {"a": 'contype="0" conaffinity="0"', "contact": pair.format("")},
        {"contact": pair.format('<exclude body1="world" body2="a"/>')},
    ):
        model = mujoco.MjModel.from_xml_string(GEOMS.format(**{"floor": "", "a": "", "condim": 3, **parts}))
        assert [str(note) for note in of_pairs(model)] == [
            "pairs: do not meet here, where masks or bodies keep their geoms apart (1: p) (dropped)"
        ]
