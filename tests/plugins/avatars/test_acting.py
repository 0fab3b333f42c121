"""Gaze, reach, bend, clips and queues of avatars."""

import json

import numpy as np
import pytest

import anysim
from anysim.errors import SpecError, TaskError
from anysim_avatars.spec import ActionSpec
from tests.plugins.avatars.people import after, avatars, lived, run_of, wait

BALL = {
    "objects": {"ball": {"source": {"sphere": 0.05}, "mass": 0.2}},
    "layout": {"ball": {"position": [1.5, 1.2, 1.4]}},
}


def gaze_error(env, family, target):
    """[degrees] between where the eye looks and what it looks at; the head is found from its body."""
    names = [body.name for body in env.engine.world.bodies]
    pose = env.engine.get_state().body_pose[0, names.index("ann.head")]
    from anysim.math import pose as P

    eye = pose[:3] + P.rotate(pose[3:], np.array([0.09, 0.0, family.people[0].neck]))
    looks = P.rotate(pose[3:], np.array([1.0, 0.0, 0.0]))
    line = (target - eye) / np.linalg.norm(target - eye)
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(looks, line)), looks @ line))


def test_the_gaze_meets_what_it_looks_at_while_walking():
    worst = 0.0
    for step, (env, family) in enumerate(
        lived(run_of([{"path": [[1.0, 0.0]], "gaze": "ball", "speed": 0.8}], world=BALL), 70)
    ):
        if step > 25:
            index = [body.name for body in env.engine.world.bodies].index("ball")
            env.engine.set_body_state([[[1.5 + 0.004 * step, 1.2, 1.4, 0, 0, 0, 1]]], bodies=[index])
            if step > 26:  # it looks at where the ball was when the step began
                worst = max(worst, gaze_error(env, family, np.array([1.5 + 0.004 * (step - 1), 1.2, 1.4])))
    assert 0.0 < worst < 0.2


@pytest.mark.parametrize(
    ("point", "short"),
    [([0.45, -0.25, 1.2], 0.0), ([0.3, -0.1, 1.0], 0.0), ([1.6, -0.2, 1.2], None), ([0.2, -0.2, 2.5], None)],
)
def test_a_reach_is_exact_or_flagged(point, short):
    action = {"clip": "idle", "reach": point, "hand": "right"}
    with after(run_of([action], height=1.75), 40) as (env, family):
        names = [body.name for body in env.engine.world.bodies]
        palm = env.engine.get_state().body_pose[0, names.index("ann.right_hand"), :3]  # the middle of the hand
        away, missed = np.linalg.norm(palm - point), family.memory["missed"][0, 0, 1]
        assert away == pytest.approx(missed, abs=1e-9)
        assert missed < 1e-9 if short is not None else missed > 0.2


def test_a_palm_stays_at_its_point_while_the_body_walks_and_bends():
    action = {
        "path": [[0.35, 0.0]],
        "speed": 0.3,
        "reach": [0.75, -0.25, 1.0],
        "bend": 0.35,
        "gaze": [0.75, -0.25, 1.0],
    }
    worst, moved, leans = 0.0, [], []
    for step, (env, family) in enumerate(lived(run_of([action], height=1.75), 62)):
        names = [body.name for body in env.engine.world.bodies]
        palm = env.engine.get_state().body_pose[0, names.index("ann.right_hand"), :3]
        if step > 40:
            worst = max(worst, np.abs(palm - action["reach"]).max())
            moved.append(family.memory["pos"][0, 0, 0])
            leans.append(family.memory["bend"][0, 0])
    assert worst < 1e-9
    assert moved[-1] - moved[0] > 0.05
    assert leans[-1] == pytest.approx(0.35)


def test_a_seat_is_sat_on():
    with after(run_of([{"clip": "sit", "seat": 0.5}], height=1.75), 60) as (_, family):
        assert family.memory["hips"][0, 0] == pytest.approx(0.5 + 0.1, abs=0.01)
        assert family.facts(0)["ann"]["doing"] == "sit"
        json.dumps(family.facts(0))


def test_actions_follow_one_another_and_begin_anew():
    seen = []
    run = run_of([{"clip": "talk", "seconds": 0.5}, {"clip": "wave", "seconds": 0.3}], again=True)
    for _, family in lived(run, 75):
        doing = family.facts(0)["ann"]["doing"]
        if not seen or seen[-1] != doing:
            seen.append(doing)
    assert seen == ["talk", "wave", "talk", "wave"]


def test_each_begins_where_it_is_told_and_does_what_only_it_is_told():
    """As one avatar that is told the same; who is told nothing of its own stands in the row of all."""
    walk = [{"path": [[1.0, 1.0], [0.0, 2.0]], "speed": 0.8}]
    seat = {"x": {"range": [1.0, 2.0]}, "y": -1.0, "yaw": 0.5, "do": ["sit"]}
    with after(run_of(["talk"], count=3, seed=5, each=[{"do": walk}, seat]), 80, seed=3) as (env, family):
        assert [family.facts(0)[f"ann_{i}"]["doing"] for i in range(3)] == ["walk", "sit", "talk"]
        assert family.memory["pos"][0, 2].tolist() == [0.0, 1.8]
        x, y = family.memory["pos"][0, 1]
        assert 1.0 < x < 2.0
        assert (y, family.memory["yaw"][0, 1]) == (-1.0, 0.5)
        walked = env.engine.get_state().body_pose[0, family.engine.world.entities[0].root].copy()
    with after(run_of(walk, seed=5), 80, seed=3) as (env, family):
        assert (env.engine.get_state().body_pose[0, family.engine.world.entities[0].root] == walked).all()


def test_what_is_asked_for_later_is_done_in_those_envs():
    with anysim.make(run_of(["idle"], num_envs=2)) as env:
        env.reset(seed=0)
        family = avatars(env)
        family.do([ActionSpec(clip="sit")], np.array([1]))
        wait(env)
        wait(env)
        assert [family.facts(i)["ann"]["doing"] for i in (0, 1)] == ["idle", "sit"]
        with pytest.raises(TaskError, match=r"no clip 'dance'.*clips: idle, walk"):
            family.do([ActionSpec(clip="dance")], np.array([0]))
        with pytest.raises(TaskError, match=r"no avatar 'bob'.*ann"):
            family.do([ActionSpec(clip="sit")], np.array([0]), "bob")
        with pytest.raises(TaskError, match="holds 32 actions"):
            family.do([ActionSpec(clip="sit")] * 33, np.array([0]))


@pytest.mark.parametrize(
    ("do", "words"),
    [
        ([{"clip": "dance"}], r"world\.families\.ann\.do\.0: there is no clip 'dance'"),
        ([{"clip": "idle", "gaze": "bal"}], r"do\.0: .*no body or object 'bal'"),
        ([{"go_to": [1, 2], "turn_to": 1.0}], r"do\.0\.turn_to.*one thing at a time"),
        ([{"path": []}], r"do\.0\.path.*1 to 16 points"),
        ([{"walk_to": [1, 2]}], r"do\.0\.walk_to: unknown key"),
    ],
)
def test_a_wrong_action_is_told_at_its_place(do, words):
    with pytest.raises(SpecError, match=words):
        anysim.make(run_of(do))
    with pytest.raises(SpecError, match=words.replace(r"do\.0", r"each\.1\.do\.0")):
        anysim.make(run_of(["idle"], each=[{}, {"do": do}]))


def test_seeds_make_people_that_differ():
    with anysim.make(run_of([], count=4, seed=3)) as env:
        world = env.engine.world
        tall = [one.height for one in avatars(env).people]
        legs = [one.leg / one.height for one in avatars(env).people]
        assert len(set(tall)) == len(set(legs)) == 4
        assert all(1.55 <= height <= 1.9 for height in tall)
        colors = [
            {geom.color for geom in world.geoms if geom.body in range(e.body_start, e.body_stop)}
            for e in world.entities
        ]
        assert len({frozenset(one) for one in colors}) > 1
        with anysim.make(run_of([], count=4, seed=3)) as again:
            assert again.engine.world.hash == world.hash
        with anysim.make(run_of([], count=4, seed=4)) as other:
            assert other.engine.world.hash != world.hash


def test_terms_know_avatars():
    run = run_of([{"clip": "sit"}])
    run["task"] |= {
        "observations": {"policy": [{"term": "avatars.motion", "avatar": "ann"}]},
        "success": {"sits": {"term": "avatars.doing", "avatar": "ann", "what": "sit"}},
    }
    with anysim.make(run) as env:
        obs, _ = env.reset(seed=0)
        assert obs["policy"].shape == (1, 5)
        assert env.step(np.zeros((1, 0))).status[0] == "success"
    run["task"]["success"]["sits"]["avatar"] = "bob"
    with pytest.raises(SpecError, match=r"no avatar 'bob' \(avatars: ann\)"):
        anysim.make(run)
