"""Qualification finds what is wrong with a robot, and calls it by its name."""

import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from anysim.api import load
from anysim.assets.catalogue import load_robot, missing_source
from anysim.compile.world import compile_with_report
from anysim_processes.own_process import ProcessEnd
from anysim_robots.drafting.draft import draft
from anysim_robots.gallery.page import contact_sheets, page
from anysim_robots.gallery.store import due, estimate, fingerprint, measure, read
from anysim_robots.qualify import apart, motion, oracle, run
from anysim_robots.qualify.apart import qualify_apart
from anysim_robots.qualify.oracle import Urdf, oracle_of
from anysim_robots.qualify.result import CHECKS, Check, Qualification, as_data, from_data
from anysim_robots.qualify.run import Durations, qualify
from anysim_robots.qualify.stage import stage
from anysim_robots.qualify.statics import source_check

ROOT = Path(__file__).parents[3]
ARM = ROOT / "tests" / "external" / "anysim-thirdarm" / "anysim_thirdarm"
SHORT = Durations(0.2, 0.1, 0.1)

BOX = """
<robot name="box">
  <link name="body">
    <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision>
  </link>
</robot>
"""


def arm(tmp_path: Path, **changes: str) -> str:
    """The stranger's arm with words of its entry or URDF replaced: `arm(tmp_path, kp_120="kp: 1")`."""
    text, urdf = (ARM / "third_arm.yaml").read_text(), (ARM / "third_arm.urdf").read_text()
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new)
    (tmp_path / "third_arm.urdf").write_text(urdf)
    (tmp_path / "third_arm.yaml").write_text(text)
    return str(tmp_path / "third_arm.yaml")


def verdicts(found: Qualification) -> dict[str, bool | None]:
    return {check.name: check.passed for check in found.checks}


def test_an_arm_with_a_follower_qualifies_with_a_figure_for_each_check() -> None:
    found = qualify(str(ARM / "third_arm.yaml"), "mujoco", SHORT)
    assert found.status == "qualified", [check.told for check in found.failed]
    assert verdicts(found) == dict.fromkeys(CHECKS, True)
    assert found.oracle == "yourdfpy"
    assert found.facts is not None
    assert (found.facts.joints, found.facts.followers, found.facts.drives) == (5, 1, 4)
    assert found.facts.mass == pytest.approx(3.86)
    figures = {check.name: check.figure or 0.0 for check in found.checks}
    assert 0 < figures["kinematics"] < 1e-9
    assert figures["replay"] == 5
    assert from_data(as_data(found)) == found


def test_what_stands_is_held_and_what_topples_is_not(tmp_path: Path) -> None:
    (tmp_path / "box.urdf").write_text(BOX)
    entry = "name: box\ndescription: a box\nsource: box.urdf\nlicense: Apache-2.0\nlicense_source: here\n"
    entry += "category: base\nbase: floating\nbase_height: 0.1\ngravity_compensation: false\nchannels: {}\n"
    (tmp_path / "box.yaml").write_text(entry)
    standing = qualify(str(tmp_path / "box.yaml"), "mujoco", SHORT)
    assert standing.status == "qualified", [check.told for check in standing.checks]
    (tmp_path / "box.urdf").write_text(re.sub("<collision>.*</collision>", "", BOX))
    sinking = qualify(str(tmp_path / "box.yaml"), "mujoco", Durations(0.4, 0.02, 0.02))
    assert "the base rises or sinks" in sinking.failed[0].words
    thin = BOX.replace("0.2 0.2 0.2", "0.01 0.2 0.2").replace("<collision>", '<collision><origin rpy="0 0.3 0"/>')
    (tmp_path / "box.urdf").write_text(thin)
    falling = qualify(str(tmp_path / "box.yaml"), "mujoco", Durations(1.0, 0.02, 0.02))
    assert [check.name for check in falling.failed] == ["hold"]
    assert "the base tilts" in falling.failed[0].words


def test_soft_gains_without_compensation_do_not_hold(tmp_path: Path) -> None:
    soft = arm(tmp_path, **{"kp: 120": "kp: 5", "home:": "gravity_compensation: false\nhome:"})
    found = qualify(soft, "mujoco", Durations(0.5, 0.02, 0.02))
    assert [check.name for check in found.failed] == ["hold"]
    assert (found.failed[0].figure or 0.0) > motion.HOLD
    assert "shoulder" in found.failed[0].words or "elbow" in found.failed[0].words


def test_another_reading_of_the_source_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """An oracle that has one link 0.1 mm elsewhere and one joint more."""
    real = run.oracle_of

    def wrong(*arguments):
        found: Any = real(*arguments)
        frames = found.frames

        def moved(q):
            return {k: v + np.array([1e-4, 0, 0, 0, 0, 0, 0]) * (k == "palm") for k, v in frames(q).items()}

        return SimpleNamespace(
            name="another",
            joints=found.joints + 1,
            mass=found.mass * 1.01,
            followers=found.followers,
            root=found.root,
            frames=moved,
        )

    monkeypatch.setattr(run, "oracle_of", wrong)
    found = qualify(str(ARM / "third_arm.yaml"), "mujoco", SHORT)
    told = {check.name: check for check in found.failed}
    assert sorted(told) == ["kinematics", "source"]
    assert told["kinematics"].figure == pytest.approx(1e-4, rel=1e-6)
    assert told["kinematics"].words.startswith("palm")
    assert "6 in the source as another reads it" in told["source"].words
    assert "kg in the source" in told["source"].words


def test_mass_that_an_importer_says_it_gave_is_no_fault(tmp_path: Path) -> None:
    """Of a link without mass that carries 40 kg; a robot that is heavier by more than it says is one."""
    inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    heavy = f'<link name="{{0}}"><inertial><mass value="{{1}}"/>{inertia}'
    joint = '<joint name="{0}{1}" type="continuous"><parent link="{0}"/><child link="{1}"/><axis xyz="0 0 1"/></joint>'
    parts = [heavy.format("a", 1), '<link name="b"/>', heavy.format("c", 40), joint.format(*"ab"), joint.format(*"bc")]
    (tmp_path / "r.urdf").write_text(f'<robot name="r">{"".join(parts)}</robot>')
    (tmp_path / "r.yaml").write_text(draft(tmp_path / "r.urdf").text(tmp_path))
    entry = load_robot(str(tmp_path / "r.yaml"))
    compiled = compile_with_report(load(stage(entry)).spec)
    oracle: Any = oracle_of(entry, compiled.world)
    notes = compiled.report["robot"]
    assert source_check(compiled.world, oracle, notes).passed
    assert oracle.mass == 41.0
    oracle.mass -= 0.01
    assert source_check(compiled.world, oracle, notes).passed is False


def test_the_oracle_moves_followers_of_followers(tmp_path: Path) -> None:
    joint = '<joint name="{1}" type="revolute"><parent link="{0}"/><child link="{1}"/><origin xyz="1 0 0"/>'
    joint += '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/>{2}</joint>'
    mimic = '<mimic joint="{0}" multiplier="{1}" offset="{2}"/>'
    joints = [joint.format(*"ab", ""), joint.format(*"bc", mimic.format("b", 2, 0.1))]
    joints.append(joint.format(*"cd", mimic.format("c", -1, 0.2)))
    links = "".join(f'<link name="{name}"/>' for name in "abcd")
    (tmp_path / "chain.urdf").write_text(f'<robot name="r">{links}{"".join(joints)}</robot>')
    found = Urdf(tmp_path / "chain.urdf", tmp_path).frames({"b": 0.3})
    turn = 0.3 + 0.7 + (0.2 - 0.7)
    assert found["d"][3:] == pytest.approx([0, 0, np.sin(turn / 2), np.cos(turn / 2)])


def test_a_fault_and_a_replay_that_differs_are_named() -> None:
    data = stage(load_robot(str(ARM / "third_arm.yaml")))
    from anysim.api import make

    with make(data, engine="mujoco", num_envs=1) as env:
        step, count = env.step, [0]

        def shaken(action):
            count[0] += 1
            if count[0] == 8:  # the third step of the second run
                env.engine.set_joint_state([[0.1]], env_ids=[0], joints=[0])
            return step(action)

        env.step = shaken
        survived, replayed = motion.random_checks(env, 0.1, 0.1)
        assert survived.passed
        assert replayed.passed is False
        assert "after 3 control steps" in replayed.words
        env.step = lambda action: env.engine.set_joint_state([[np.nan]], env_ids=[0], joints=[0]) or step(action)
        with pytest.raises(Exception, match=r"finite|number"):
            motion.random_checks(env, 0.1, 0.1)


def test_mjcf_is_held_against_raw_mujoco(tmp_path: Path) -> None:
    (tmp_path / "pair.xml").write_text("""
      <mujoco><compiler angle="radian"/><worldbody><body name="stand" pos="0.1 0 0.2"><geom size="0.05" mass="1"/>
        <body name="arm" pos="0 0 0.1" euler="0.2 0 0">
          <joint name="swing" axis="0 1 0" range="-1 1" limited="true" ref="0.3"/>
          <geom type="capsule" size="0.02 0.1" mass="0.3"/>
          <body name="tip" pos="0 0 0.2"><joint name="slide" type="slide" axis="0 0 1" range="0 0.1" limited="true"/>
            <geom size="0.02" mass="0.1"/></body></body></body></worldbody></mujoco>""")
    entry = "name: pair\ndescription: two\nsource: pair.xml\nlicense: Apache-2.0\nlicense_source: here\ncategory: arm\n"
    entry += "channels: {arm: {joints: [swing, slide], gains: {kp: 50, kd: 5, effort_limit: 50}}}\nhome: {swing: 0.3}\n"
    (tmp_path / "pair.yaml").write_text(entry)
    found = qualify(str(tmp_path / "pair.yaml"), "mujoco", SHORT)
    assert found.oracle == "raw MuJoCo"
    assert found.status == "qualified", [check.told for check in found.checks]


def test_parts_are_put_together_by_the_oracle_alone() -> None:
    """The composition against frames that are known by hand: a box on the palm of the arm."""
    part = SimpleNamespace(
        source="third_arm.urdf",
        prefix="b_",
        link="palm",
        position=(0.0, 0.0, 0.05),
        roll_pitch_yaw=(0.0, 0.0, np.pi / 2),
    )
    entry = SimpleNamespace(spec=SimpleNamespace(parts=[part]), file=ARM / "third_arm.yaml")
    one = oracle.Urdf(ARM / "third_arm.urdf", ARM)
    both = oracle._Composed(one, entry)
    assert (both.joints, both.followers["b_finger_mirror"].leader) == (10, "b_finger")
    frames = both.frames({"turn": 0.4, "b_turn": 0.7})
    alone = dict(one.frames({"turn": 0.4}))
    palm = alone["palm"]
    from anysim.math import pose as P

    place = P.compose(palm, P.pose((0.0, 0.0, 0.05), P.from_roll_pitch_yaw(np.array([0.0, 0.0, np.pi / 2]))))
    np.testing.assert_allclose(frames["b_foot"], place, atol=1e-12)
    wanted = P.compose(place, dict(one.frames({"turn": 0.7}))["palm"])
    np.testing.assert_allclose(frames["b_palm"][:3], wanted[:3], atol=1e-12)


def test_an_optional_source_that_is_not_installed_is_absent(tmp_path: Path) -> None:
    name = arm(tmp_path, **{"source: third_arm.urdf": "source: package:no_such_models/arm.urdf\nneeds: nice-models"})
    assert "pip install 'nice-models'" in missing_source(load_robot(name))
    found = qualify(name, "mujoco", SHORT)
    assert (found.status, found.checks) == ("absent", ())
    assert "no_such_models" in found.why
    assert qualify_apart(name, "mujoco", SHORT).found.status == "absent"


def test_what_needs_a_missing_reader_is_not_asked_and_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "yourdfpy", None)
    found = qualify(str(ARM / "third_arm.yaml"), "mujoco", SHORT)
    assert (found.status, found.oracle) == ("qualified", "")
    unasked = {check.name: check.words for check in found.checks if check.passed is None}
    assert set(unasked) == {"source", "kinematics"}
    assert all("pip install 'anysim-robots[check]'" in words for words in unasked.values())
    assert "not asked" in found.why


def test_a_process_that_dies_is_a_failed_check(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check that it had announced last failed, with the last line of what it said."""
    ended = ProcessEnd("build\nhold\n", "words\nlast words\n", "was ended by signal 11 (SIGSEGV)")
    monkeypatch.setattr(apart, "run_module", lambda module, job, limit: ended)
    found = qualify_apart(str(ARM / "third_arm.yaml"), "mujoco", SHORT).found
    assert found.status == "failed"
    cause = "its process was ended by signal 11 (SIGSEGV): last words"
    assert found.failed[0] == Check("hold", False, words=cause)


@pytest.mark.slow
def test_measuring_goes_on_where_it_stopped_and_starts_anew_for_another_entry(tmp_path: Path) -> None:
    name, store = arm(tmp_path), tmp_path / "robots.json"
    told: list[str] = []
    stored = measure(store, [name], ["mujoco"], SHORT, pictures=tmp_path / "pictures", tell=told.append)
    assert told == [f"{name} on mujoco: qualified"]
    assert stored == read(store)
    assert estimate(stored, 2) > 0
    assert stored["robots"]["third_arm"]["digest"] == fingerprint(load_robot(name))
    changed = arm(tmp_path, **{"kp: 120": "kp: 121"})
    assert fingerprint(load_robot(changed)) != stored["robots"]["third_arm"]["digest"]
    assert due(stored, [changed], ["mujoco"], SHORT) == [(changed, "mujoco")]
    html = page(stored, ["mujoco", "sapien"], tmp_path)
    assert "third_arm" in html
    assert "://" not in html
    assert "not measured" in html
    for sheet in contact_sheets(stored, ["mujoco"], tmp_path):
        assert sheet.stat().st_size < 1_000_000
