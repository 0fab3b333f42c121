"""Recording and replaying episodes in which not the same things are there."""

import json
from pathlib import Path

import numpy as np

from anysim.record.reader import open_trajectory
from anysim.record.replay import replay
from anysim.skills.runner import SkillPolicy
from anysim_recording.collector import Collector
from tests.task.helpers import arm

VARIED = [
    "world.objects.cube.source={choice: [{box: [0.04, 0.04, 0.04]}, {sphere: 0.02}]}",
    "world.objects.cube.scale={range: [0.8, 1.2]}",
    "world.objects.toy={source: {box: [0.03, 0.03, 0.03]}, count: {range: [0, 2]}}",
    "world.layout.toy={on: table, x: 0.6, y: {range: [-0.3, 0.3]}}",
    "task.success={at_goal: null, at_rest: null, there: {term: present, object: cube}}",
]


def test_what_was_drawn_is_kept_and_each_episode_replays_to_the_bit(tmp_path: Path) -> None:
    with arm(3, *VARIED) as env:
        results = Collector(env, SkillPolicy(env), tmp_path, 6, 0).run()
        kept = [result.path for result in results if result.path is not None]
        bodies = [body.name for body in env.engine.world.bodies]
    assert len(kept) == 6
    kinds = set()
    for path in kept:
        found = open_trajectory(path)
        drawn = found.manifest.drawn
        kinds.add((drawn["population/cube/source"], drawn["population/toy/count"]))
        toys = [np.array(found.initial_state["body_pose"][bodies.index(f"toy_{i}")]) for i in range(2)]
        away = [toy.tolist() == [0, 0, 0, 0, 0, 0, 1] for toy in toys]
        assert away == [i >= drawn["population/toy/count"] for i in range(2)]
        again = replay(path)
        assert again.identical
        assert again.explanation == ""
    assert len(kinds) > 2
    _recorded_with(path, linear_algebra="openblas Elsewhere")
    assert "the linear algebra was openblas Elsewhere and is " in replay(path).explanation


def _recorded_with(path: Path, **clock: str) -> None:
    """Change what a manifest says of the machine."""
    manifest = json.loads((path / "manifest.json").read_text())
    manifest["clock"] |= clock
    (path / "manifest.json").write_text(json.dumps(manifest))
