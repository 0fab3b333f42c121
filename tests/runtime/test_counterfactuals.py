"""The same episode with one factor changed: it differs from when that factor acts, and no other draw moves."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from anysim.errors import CapabilityError, TaskError
from anysim.randomization.streams import OVERRIDDEN
from anysim.record import replay
from anysim.record.json import dump_json
from tests.runtime import light
from tests.runtime.model import STATE, action

REAL = [pytest.param(name, marks=pytest.mark.slow) for name in light.REAL]


def states(env, steps: int) -> list[dict[str, bytes]]:
    """What env 0 is like now and after each of some steps."""
    seen = []
    for step in range(steps + 1):
        if step:
            env.step(np.zeros((env.num_envs, env.action_dim)))
        state = env.engine.get_state()
        seen.append({name: getattr(state, name)[0].tobytes() for name in STATE})
    return seen


@pytest.fixture(scope="module", params=[*REAL])
def thrown(request):
    """A block that flies along above the ground, lands after some steps, and slides."""
    layout = light.SLIDE["world"]["layout"] | {"block": {"position": [0.3, 0.6, 0.1]}}
    objects = light.SLIDE["world"]["objects"]
    objects = objects | {"block": objects["block"] | {"friction": 0.6}}  # a constant, to see it come back
    spec = light.changed(
        light.SLIDE, "task.events.shove", world__layout=layout, world__objects=objects, task__horizon=60
    )
    with light.make(request.param, 2, spec) as env:
        yield env


def begin(env):
    env.reset(seed=2)
    block = env.engine.index.entity("block").root
    env.engine.set_body_state(twist=np.tile([3, 0, 0, 0, 0, 0], (2, 1, 1)), bodies=[block])
    for _ in range(2):
        env.step(np.zeros((2, env.action_dim)))
    return env.snapshot(), block


def test_friction_acts_from_the_first_touch(thrown) -> None:
    """Identical bits in the air, another path on the ground; the touch is when the block's middle is at half its size.

    Both of the pair name the factor, with its present value and another one: SAPIEN builds a scene anew for a change of
    friction, and with it the contacts of what lies on the ground, which moves last bits.
    """
    env = thrown
    snapshot, block = begin(env)
    steps, paths, first = 30, [], []
    for friction in (0.6, 1.4):
        env.reset_to(snapshot, overrides={"objects.block.friction": friction})
        paths.append(states(env, steps))
        pose = np.frombuffer(paths[-1][-1]["body_pose"]).reshape(-1, 7)
        first.append(pose[block, 0])
    fall = [np.frombuffer(s["body_pose"]).reshape(-1, 7)[block, 2] for s in paths[0]]
    touch = next(step for step, z in enumerate(fall) if z < 0.042)
    assert 2 < touch < 20
    differing = [step for step in range(steps + 1) if paths[0][step] != paths[1][step]]
    assert differing
    assert differing[0] in (touch, touch + 1), f"touch in step {touch}, first difference in {differing[0]}"
    assert first[1] < first[0] - 0.05, "the rough block comes to rest earlier"
    assert env.engine.get_parameters("geom.friction", [0], env.engine.index.geoms_of(env.engine.index.entity("block")))[
        0, 0
    ] == pytest.approx(1.4)


def test_a_colour_changes_no_trajectory(thrown) -> None:
    env = thrown
    snapshot, _ = begin(env)
    env.reset_to(snapshot)
    plain = states(env, 30)
    env.reset_to(snapshot, overrides={"objects.block.color": "yellow"})
    assert states(env, 30) == plain
    geoms = env.engine.index.geoms_of(env.engine.index.entity("block"))
    assert np.allclose(env.engine.get_parameters("geom.color", None, geoms)[:, 0, :2], [1, 1], atol=0.3)


def test_gravity_acts_at_once(thrown) -> None:
    if "world.gravity" not in thrown.engine.parameters:
        with pytest.raises(CapabilityError, match=r"cannot change 'world.gravity'"):
            thrown.reset_to(begin(thrown)[0], overrides={"physics.gravity": (0, 0, -1.62)})
        return
    env = thrown
    snapshot, block = begin(env)
    heights = []
    for overrides in (None, {"physics.gravity": [0, 0, -1.62]}):
        env.reset_to(snapshot, overrides=overrides)
        states(env, 2)
        heights.append(env.engine.get_state().body_pose[0, block, 2])
    # eight physics steps of 5 ms of fall with 9.81 - 1.62 m/s^2 less, velocity before position
    assert heights[1] - heights[0] == pytest.approx((9.81 - 1.62) * 0.005**2 * 8 * 9 / 2, abs=1e-4)


@pytest.mark.parametrize("engine", light.ENGINES)
def test_an_episode_begins_again_with_one_factor_changed(get, engine) -> None:
    """All other draws are what they were; the changed one is marked, and the next episode is as if nothing had been."""
    env = get(engine, 2)
    for path, name, value in (
        ("layout.block.x", "layout/block/x", 0.33),
        ("objects.block.mass", "scene/block/mass", 0.77),
        ("world.objects.ball.friction", "scene/ball/friction", 0.11),
        ("robots.arm.home_noise", "robot/arm/home_noise_std", 0.0),
        ("task.command.goal.position", "task/command/goal/position", (0.4, 0.3, 0.04)),
        ("task.events.polish.friction", "task/event/polish/friction", 0.123),
    ):
        env.reset(seed=5)
        plain, seeds = [dict(d) for d in env.streams.draws], env.streams.episode_seed.tolist()
        following = [env.reset()[0]["policy"], [dict(d) for d in env.streams.draws]]
        env.reset(seed=5, episode_seeds=seeds)
        env.reset(episode_seeds=seeds, overrides={path: value})
        for i, drawn in enumerate(env.streams.draws):
            other = {k for k in plain[i].keys() | drawn.keys() if plain[i].get(k) != drawn.get(k)}
            if path == "robots.arm.home_noise":  # without it no joint is disturbed
                other = {k for k in other if "arm." not in k}
            assert other == {name}, path
            assert drawn[name] == value
            assert env.streams.origins[i][name].stream == OVERRIDDEN
        env.reset(seed=5)
        again = [env.reset()[0]["policy"], [dict(d) for d in env.streams.draws]]
        assert (again[0] == following[0]).all()
        assert again[1] == following[1]


@pytest.mark.parametrize("engine", light.ENGINES)
def test_a_constant_comes_back_after_the_episode(get, engine) -> None:
    env = get(engine, 2)
    geoms = env.engine.index.geoms_of(env.engine.index.entity("ball"))

    def colours() -> np.ndarray:
        return env.engine.get_parameters("geom.color", None, geoms)[:, 0]

    env.reset(seed=1)
    usual = colours()
    env.reset(seed=1, overrides=[{}, {"objects.ball.color": (0.1, 0.9, 0.1)}])
    assert np.allclose(colours()[1, :3], [0.1, 0.9, 0.1])
    assert (colours()[0] == usual[0]).all()
    assert env.streams.draws[1]["scene/ball/color"] == (0.1, 0.9, 0.1)
    kept = env.snapshot(np.array([False, True]))
    env.reset(mask=np.array([False, True]))
    assert (colours() == usual).all()
    assert not env.streams.overridden[1]
    env.reset_to(kept, [0])  # what is overridden is part of the snapshot, and its end too
    assert np.allclose(colours()[0, :3], [0.1, 0.9, 0.1])
    env.reset()
    assert (colours() == usual).all()


def test_a_step_event_can_change_midway(get) -> None:
    env = get("null", 2)
    env.reset(seed=1)
    env.step(np.zeros((2, env.action_dim)))
    snapshot = env.snapshot()
    env.reset_to(snapshot, overrides={"task.events.shove.friction": 0.31})
    env.step(np.zeros((2, env.action_dim)))
    assert env.streams.draws[0]["task/event/shove/friction@2"] == 0.31
    assert "task/event/shove/friction@1" in env.streams.draws[0]
    assert action(1, 1, 2).shape == (2,)


def test_what_cannot_be_overridden_is_refused_with_a_reason(get) -> None:
    env = get("null", 2)
    env.reset(seed=1)
    snapshot, before = env.snapshot(), env.obs["policy"]
    for overrides, says in (
        (
            {"objects.block.frictoin": 0.1},
            r"'objects.block.frictoin' .*did you mean 'objects.block.friction'.*What can: ",
        ),
        ({"objects.block.source": {"sphere": 1}}, "built into the world: make another env"),
        ({"layout.block.x": 0.1}, r"settled when an episode begins .*env.reset\(episode_seeds"),
        ({"objects.block.friction": -1}, "'objects.block.friction' cannot be -1: .*greater than or equal to 0"),
        ({"objects.block.mass": {"range": [0.1, 0.2]}}, "one value"),
        ({"objects.block.mass": "heavy"}, "cannot be 'heavy'"),
        ([{"objects.block.mass": 0.1}], "a list of 2"),
    ):
        with pytest.raises(TaskError, match=says):
            env.reset_to(snapshot, overrides=overrides)
        assert (env.obs["policy"] == before).all()
    with pytest.raises(TaskError, match="did you mean"):
        env.reset(seed=1, overrides={"layout.block.xx": 0.1})
    assert env.streams.episode_seed.tolist() == list(snapshot.streams["episode_seed"])


def test_a_recorded_episode_is_replayed_with_its_overrides(get) -> None:
    """What a manifest says of them is plain data, and enough."""
    env = get("null", 1)
    env.reset(seed=3, overrides={"layout.block.x": 0.31, "objects.ball.color": (0.5, 0.25, 0.0)})
    first, seed = env.obs["policy"], int(env.streams.episode_seed[0])
    said = json.loads(dump_json(env.streams.overridden[0]))
    env.reset(seed=9)
    replay.begin(env, SimpleNamespace(episode_seed=seed, overridden=said, drawn={}))
    assert (env.obs["policy"] == first).all()
    assert env.streams.overridden[0]["world.objects.ball.color"] == (0.5, 0.25, 0.0)
