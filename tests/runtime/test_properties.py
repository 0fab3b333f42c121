"""An env's episode is its own: whatever the number of envs, the shards, the order of resets, and what else is drawn."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from anysim.randomization.streams import episode_seed
from tests.runtime import light
from tests.runtime.model import STATE, action, moment
from tests.runtime.test_programs import settled

SEED, HORIZON = 4, 9


def follow(env, alone, order: list[list[int]], episodes: int) -> int:
    """Step all running envs, reset those that ended in the order given; returns how many moments were compared."""
    n, compared = env.num_envs, 0
    env.reset(seed=SEED)
    begun, steps = [1] * n, [0] * n
    waiting: list[int] = []
    for turn in range(10 * HORIZON * episodes):
        running = env.running
        if running.any():
            actions = np.stack([action(int(env.streams.episode_seed[i]), steps[i], env.action_dim) for i in range(n)])
            result = env.step(actions, running)
            for i in np.flatnonzero(running):
                steps[i] += 1
                wanted = alone.at(episode_seed(SEED, int(i), begun[i] - 1), steps[i])
                assert moment(env, i, result.reward[i]) == wanted, f"env {i}, episode {begun[i] - 1}, step {steps[i]}"
                compared += 1
        waiting += [i for i in range(n) if not env.running[i] and i not in waiting and begun[i] < episodes]
        for i in [i for i in order[turn % len(order)] if i in waiting]:
            env.reset(mask=np.arange(n) == i)
            waiting.remove(i)
            begun[i], steps[i] = begun[i] + 1, 0
        if not waiting and not env.running.any():
            break
    assert begun == [episodes] * n
    return compared


@pytest.mark.parametrize("engine", light.ENGINES)
@pytest.mark.parametrize("spec", light.SPECS)
def test_an_episode_depends_on_its_own_seed_alone(get, alone, engine, spec) -> None:
    """Not on the number of envs, nor on when and in which order the others are reset."""
    order = st.lists(st.lists(st.integers(0, 4), min_size=1, max_size=5, unique=True), min_size=1, max_size=4)

    @settled(8 if engine == "null" else 30)
    @given(st.integers(1, 5), order)
    def run(n, when) -> None:
        everybody = [*when, list(range(n))]  # so that nobody waits for ever
        assert follow(get(engine, n, spec), alone(engine, spec), everybody, 2) >= 2 * n

    run()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["null", *light.REAL])
@pytest.mark.parametrize("spec", ["slide", "mixed"])
def test_an_episode_does_not_depend_on_shards(get, alone, engine, spec) -> None:
    assert follow(get(engine, 4, spec, shards=2), alone(engine, spec), [[0, 1], [3], [2, 0, 1]], 3) >= 12


@pytest.mark.parametrize("engine", light.ENGINES)
@pytest.mark.parametrize("spec", ["slide", "mixed"])
def test_a_partial_reset_touches_its_rows_alone(get, engine, spec) -> None:
    """To the bit: state, observation, streams and managers of the others; also by `reset_to`."""
    env = get(engine, 4, spec)

    def rows(ids: np.ndarray) -> dict[str, bytes]:
        state = env.engine.get_state()
        data = {name: np.array(getattr(state, name)[ids]).tobytes() for name in (*STATE, "joint_effort")}
        data |= {f"obs {group}": values[ids].tobytes() for group, values in env.obs.items()}
        data |= {f"info {name}": values[ids].tobytes() for name, values in env.info.items()}
        snapshot = env.snapshot(np.isin(np.arange(4), ids))
        data |= {f"{m}.{k}": np.array(v).tobytes() for m, d in snapshot.managers.items() for k, v in d.items()}
        return data | {"streams": repr(snapshot.streams).encode()}

    @settled(10 if engine == "null" else 40)
    @given(st.lists(st.booleans(), min_size=4, max_size=4), st.integers(0, 6), st.booleans())
    def run(mask, steps, restored) -> None:
        env.reset(seed=1)
        first = env.snapshot(np.array(mask))
        for step in range(steps):
            env.step(np.stack([action(i, step, env.action_dim) for i in range(4)]), env.running)
        others, chosen = np.flatnonzero(~np.array(mask)), np.flatnonzero(mask)
        before = rows(others)
        if restored:
            env.reset_to(first, chosen)
        else:
            env.reset(mask=np.array(mask))
        assert rows(others) == before

    run()


def draws(engine: str, spec) -> list[dict]:
    """What three envs draw in two episodes and a few steps of each, by name."""
    with light.make(engine, 3, spec) as env:
        seen: list[dict] = []
        for episode in range(2):
            env.reset(seed=7 if episode == 0 else None)
            for step in range(4):
                env.step(np.stack([action(i, step, env.action_dim) for i in range(3)]), env.running)
            seen += [dict(drawn) for drawn in env.streams.draws]
        return seen


REMOVABLE = {
    "world.objects.block.mass": "scene/block/mass",
    "world.objects.block.friction": "scene/block/friction",
    "world.objects.block.color": "scene/block/color",
    "world.objects.ball.density": "scene/ball/density",
    "world.objects.ball.friction": "scene/ball/friction",
    "world.layout.block.x": "layout/block/x",
    "world.layout.block.y": "layout/block/y",
    "world.layout.block.yaw": "layout/block/yaw",
    "world.layout.ball.x": "layout/ball/x",
    "world.robots.arm.home_noise": "robot/arm",
    "task.events.polish": "task/event/polish",
    "task.events.shove": "task/event/shove",
}
"""Parts that can be taken out of the spec, and the beginnings of the names of their draws."""
ADDED = {
    "world__objects__ball__color": {"choice": ["red", "blue"]},
    "world__layout__ball__yaw": {"range": [-1, 1]},
    "world__layout__block__pitch": {"range": [-0.1, 0.1]},
    "task__events__extra": {"term": "set_friction", "object": "block", "friction": {"range": [0.2, 0.3]}},
}


def _ours(name: str, prefix: str) -> bool:
    # the arm's noise is drawn for each of its joints, under their names
    whole = name.split("@")[0]
    return whole == prefix or whole.startswith(f"{prefix}/") or (prefix == "robot/arm" and name.startswith("robot/"))


@pytest.mark.parametrize("engine", light.ENGINES)
def test_taking_a_term_out_moves_no_other_draw(engine) -> None:
    whole = draws(engine, light.SLIDE)
    for path, prefix in REMOVABLE.items():
        gone = [name for name in whole[0] if _ours(name, prefix)]
        # a step event draws only where it is due, so look at all episodes
        assert gone or any(_ours(name, prefix) for one in whole for name in one), f"{path} draws nothing"
        rest = [{k: v for k, v in one.items() if not _ours(k, prefix)} for one in whole]
        instead = {"world__layout__block__y": 0.15} if path == "world.layout.block.y" else {}  # still clear of the ball
        other = light.changed(light.SLIDE, *(() if instead else (path,)), **instead)
        assert draws(engine, other) == rest, f"without {path}"


@pytest.mark.parametrize("engine", light.ENGINES)
def test_adding_a_term_moves_no_other_draw(engine) -> None:
    whole = draws(engine, light.SLIDE)
    for path, value in ADDED.items():
        more = draws(engine, light.changed(light.SLIDE, **{path: value}))
        assert len(more[0]) > len(whole[0]), f"{path} draws nothing"
        kept = [{k: v for k, v in one.items() if k in names} for one, names in zip(more, whole, strict=True)]
        assert kept == whole, f"with {path}"


def test_a_manager_that_has_nothing_to_do_moves_no_draw() -> None:
    """Without robots there is no arm to disturb; all else is drawn as with it."""
    events = {"polish": light.SLIDE["task"]["events"]["polish"]}
    spec = light.changed(light.SLIDE, "task.rewards.smooth", "world.robots", task__events=events)
    policy = [o for o in light.SLIDE["task"]["observations"]["policy"] if not isinstance(o, str)]
    spec["task"]["observations"]["policy"] = policy
    with_arm = draws("null", light.changed(light.SLIDE, task__events=events))
    without = draws("null", spec)
    assert without == [{k: v for k, v in one.items() if not k.startswith("robot/")} for one in with_arm]
