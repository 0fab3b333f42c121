"""Explanations of an episode's draws: without its engine, and the same as the episode's own."""

from pathlib import Path

import anysim
from anysim_inspect.draws import explain
from tests.task.helpers import BLOCKS


def test_the_explained_draws_are_those_of_the_run() -> None:
    with anysim.make(BLOCKS, engine="mujoco", num_envs=3) as env:
        env.reset(seed=4)
        env.reset()
        drawn, seed = env.streams.draws[2], int(env.streams.episode_seed[2])
    found = explain(BLOCKS, seed=4, env=2, episode=1)
    assert found.episode_seed == seed
    assert {draw.name: draw.value for draw in found.draws} == drawn


def test_every_draw_names_its_stream_and_its_line(tmp_path: Path) -> None:
    file = tmp_path / "world.yaml"
    file.write_text(
        "world:\n"
        "  objects:\n"
        "    cube:\n"
        "      source: {box: [0.1, 0.1, 0.1]}\n"
        "      mass: {range: [1.0, 2.0], shared: heavy}\n"
        "      friction: {range: [0.5, 0.9], ratio: 0.0, otherwise: 0.7}\n"
        "task: {observations: {policy: [{term: frame_pose, frame: cube}]}}\n"
    )
    mass, friction = explain(file).draws
    assert (mass.name, mass.stream, mass.path) == ("scene/cube/mass", "shared/heavy", "world.objects.cube.mass")
    assert mass.where.endswith("world.yaml:5:13")
    assert 1.0 <= mass.value <= 2.0
    assert (friction.value, friction.stream) == (0.7, "scene/cube/friction/ratio")
    assert friction.where.endswith("world.yaml:6:17")
