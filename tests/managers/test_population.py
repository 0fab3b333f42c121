"""Populations, episode by episode: numbers, sources and sizes."""

import hashlib
import json
import subprocess
import sys
from collections import Counter
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.conventions import Array
from anysim.engine.factory import engine_class, runnable
from anysim.engine.presence import Lifecycle
from anysim.task.env import TaskEnv
from tests.task.helpers import BLOCKS

BALL, BRICK, ROD = {"sphere": 0.03}, {"box": [0.05, 0.06, 0.07]}, {"capsule": [0.02, 0.06]}
TOYS: dict[str, Any] = {
    **BLOCKS,
    "world": {
        "name": "toys",
        "objects": {
            "table": {"source": {"box": [1.0, 1.0, 0.4]}, "fixed": True},
            "mug": {
                "source": {"choice": [BALL, BRICK, ROD], "weights": [1, 2, 1]},
                "scale": {"range": [0.8, 1.2]}, "sizes": 3, "mass": {"range": [0.1, 0.4]},
            },
            "cube": {
                "source": {"choice": [BRICK, BALL]}, "count": {"range": [1, 4]}, "color": {"choice": ["red", "blue"]},
            },
            "extra": {"source": ROD, "count": {"choice": [0, 1]}},
        },
        "layout": {
            "table": {"position": [0.0, 0.0, 0.2]},
            "mug": {"on": "table", "x": {"range": [-0.4, -0.2]}, "y": {"range": [-0.4, 0.4]}},
            "cube": {"on": "table", "x": {"range": [0.0, 0.4]}, "y": {"range": [-0.4, 0.4]}, "clearance": 0.002},
            "extra": {"on": "table", "x": -0.1, "y": {"range": [-0.4, 0.4]}},
        },
    },
    "task": {
        "horizon": 5,
        "observations": {
            "policy": [
                {"term": "frame_pose", "frame": "mug"}, {"term": "category_pose", "category": "cube"},
                {"term": "category_present", "category": "cube"}, {"term": "present", "object": "extra_0"},
            ]
        },
    },
}  # fmt: skip


def toys(num_envs: int = 1, *overrides: str, engine: str = "null") -> TaskEnv:
    return anysim.make(TOYS, engine=engine, num_envs=num_envs, overrides=overrides)


def varying_engines() -> list[str]:
    """The installed engines in which things come and go."""
    return [name for name in runnable() if engine_class(name).lifecycle is not Lifecycle.P3]


def test_every_slot_has_at_most_one_entity_and_the_draws_say_which() -> None:
    with toys(64) as env:
        env.reset(seed=0)
        world, presence = env.engine.world, env.engine.presence
        for slot in world.slots:
            assert (presence[:, slot.entities].sum(axis=1) <= 1).all()
        for i, drawn in enumerate(env.streams.draws):
            there = {world.entities[e].name for e in np.flatnonzero(presence[i])}
            texts = ["sphere 0.03", "box 0.05 0.06 0.07", "capsule 0.02 0.06"]
            which = texts.index(drawn["population/mug/source"]) * 3
            size = np.argmin(np.abs(np.array([0.8 + 0.4 / 6, 1.0, 1.2 - 0.4 / 6]) - drawn["population/mug/scale"]))
            assert f"mug~{which + size}" in there
            assert sum(name.startswith("cube_") for name in there) == drawn["population/cube/count"]
            assert ("extra_0" in there) == (drawn["population/extra/count"] == 1)


def test_numbers_and_sources_come_as_often_as_they_should() -> None:
    with toys(400) as env:
        env.reset(seed=1)
        sources = Counter(str(d["population/mug/source"]).split()[0] for d in env.streams.draws)
        numbers = Counter(d["population/cube/count"] for d in env.streams.draws)
    # five standard deviations of 400 draws with p = 1/4 are 43
    assert abs(sources["box"] - 200) < 50
    assert abs(sources["sphere"] - 100) < 44
    assert sorted(numbers) == [1, 2, 3, 4]
    assert max(abs(n - 100) for n in numbers.values()) < 44


def test_what_is_absent_is_neither_drawn_for_nor_placed() -> None:
    with toys(16) as env:
        env.reset(seed=2)
        state, presence = env.engine.get_state(), env.engine.presence
        for drawn in env.streams.draws:
            for k in range(4):
                here = k < int(str(drawn["population/cube/count"]))
                named = {name for name in drawn if f"/cube_{k}/" in name}
                assert bool(named) == here
        away = np.argwhere(~presence)
        roots = np.array([e.root for e in env.engine.world.entities])
        assert (state.body_pose[away[:, 0], roots[away[:, 1]]] == [0, 0, 0, 0, 0, 0, 1]).all()
        lifted = state.body_pose[:, roots, 2] > 0.35
        assert lifted[:, 1:][presence[:, 1:]].all()  # on the table, whatever it is


def test_the_engine_is_asked_only_where_someone_comes_or_goes() -> None:
    with toys(8) as env:
        env.reset(seed=3)
        asked: list[Array] = []
        original = env.engine.reset

        def watched(env_ids: Any = None, present: Any = None) -> None:
            if present is not None:
                asked.append(np.array(env_ids))
            original(env_ids, present)

        env.engine.reset = watched  # type: ignore[method-assign]
        before = env.engine.presence
        env.reset()
        changed = np.flatnonzero((env.engine.presence != before).any(axis=1))
        assert 0 < len(changed)
        assert np.concatenate(asked).tolist() == changed.tolist()
        asked.clear()
        env.reset(episode_seeds=env.streams.episode_seed.copy())
        assert asked == []


def test_a_partial_reset_leaves_the_others() -> None:
    with toys(4) as env:
        env.reset(seed=3)
        before, poses = env.engine.presence, env.engine.get_state().body_pose.copy()
        env.reset(mask=np.array([False, True, False, False]))
        others = [0, 2, 3]
        assert (env.engine.presence[others] == before[others]).all()
        assert (env.engine.get_state().body_pose[others] == poses[others]).all()


def test_a_snapshot_brings_back_what_was_present() -> None:
    with toys(3) as env:
        first = env.reset(seed=4)[0]["policy"]
        saved, before = env.snapshot(), env.engine.presence
        env.reset()
        assert (env.engine.presence != before).any()
        again = env.reset_to(saved)["policy"]
        assert (env.engine.presence == before).all()
        assert (again == first).all()


def test_one_more_thing_that_varies_moves_no_other_draw() -> None:
    more = "world.objects.other={source: {choice: [{sphere: 0.02}, {box: [0.1, 0.1, 0.1]}]}, count: {range: [0, 2]}}"
    with toys(8) as plain, toys(8, more, "world.layout.other={on: table}") as with_other:
        plain.reset(seed=5)
        with_other.reset(seed=5)
        for a, b in zip(plain.streams.draws, with_other.streams.draws, strict=True):
            assert a == {name: value for name, value in b.items() if "/other" not in name}
            assert len(b) > len(a)


def test_what_shares_a_name_is_drawn_together() -> None:
    share = [
        "world.objects.mug.source.shared=kind", "world.objects.mug.source.weights=[1, 1, 1]",
        "world.objects.spare={source: {choice: [{sphere: 0.02}, {box: [0.1, 0.1, 0.1]}, {sphere: 0.01}], shared: kind}}",  # noqa: E501
        "world.layout.spare={on: table}",
    ]  # fmt: skip
    with toys(32, *share) as env:
        env.reset(seed=6)
        pairs = {(d["population/mug/source"], d["population/spare/source"]) for d in env.streams.draws}
    assert pairs == {
        ("sphere 0.03", "sphere 0.02"),
        ("box 0.05 0.06 0.07", "box 0.1 0.1 0.1"),
        ("capsule 0.02 0.06", "sphere 0.01"),
    }


def test_a_ratio_leaves_the_nominal_source() -> None:
    with toys(
        64, "world.objects.mug.source={choice: [{sphere: 0.03}, {box: [0.1, 0.1, 0.1]}], weights: [1, 1], ratio: 0.5}"
    ) as env:
        env.reset(seed=7)
        kinds = Counter(str(d["population/mug/source"]).split()[0] for d in env.streams.draws)
    assert 32 < kinds["sphere"] < 62  # three of four


def trajectory(engine: str, num_envs: int, episodes: int = 20) -> list[str]:
    """For each env a hash of what was drawn and of every state of its episodes."""
    digests = [hashlib.sha256() for _ in range(num_envs)]
    with toys(num_envs, engine=engine) as env:
        for episode in range(episodes):
            env.reset(seed=11 if episode == 0 else None)
            for _ in range(3):
                env.step(np.zeros((num_envs, 0)))
                state, obs = env.engine.get_state(), env.obs["policy"]
                for i, digest in enumerate(digests):
                    digest.update(repr(sorted(env.streams.draws[i].items())).encode())
                    for part in (state.body_pose, state.body_twist, env.engine.presence, obs):
                        digest.update(np.ascontiguousarray(part[i]).tobytes())
    return [digest.hexdigest() for digest in digests]


@pytest.mark.slow
@pytest.mark.parametrize("engine", varying_engines())
def test_a_heterogeneous_scene_is_the_same_in_another_process_and_with_another_number_of_envs(engine: str) -> None:
    code = f"from tests.managers.test_population import trajectory; print(trajectory({engine!r}, 16))"
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    here = trajectory(engine, 16)
    assert other.stdout.strip().splitlines()[-1] == repr(here)
    assert trajectory(engine, 1) == here[:1]
    assert len(set(here)) == 16


def test_what_is_drawn_is_the_same_on_every_machine() -> None:
    """Sixteen envs, twenty episodes, against a digest that is written here."""
    digest = hashlib.sha256()
    with toys(16, engine="null") as env:
        for episode in range(20):
            env.reset(seed=11 if episode == 0 else None)
            for drawn in env.streams.draws:
                digest.update(json.dumps({k: _rounded(v) for k, v in sorted(drawn.items())}).encode())
    assert digest.hexdigest() == "6a6d28259e35422d6a00e2b8f734385986946fb923ec84af80bb6cb3879218cb"


def _rounded(value: object) -> object:
    """Ten digits: the last bit of a logarithm may differ between machines."""
    if isinstance(value, tuple):
        return [_rounded(part) for part in value]
    return f"{value:.10g}" if isinstance(value, float) else str(value)
