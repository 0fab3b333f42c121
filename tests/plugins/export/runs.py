"""A short recorded run with two small cameras, and its trajectories."""

from pathlib import Path

import anysim
from anysim.record.collector import Collector
from anysim.record.names import trajectories
from anysim.record.reader import open_trajectory
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_drawing

SMALL = ("record.cameras=[front,wrist]", "world.cameras.front.size=[48, 32]", "world.cameras.wrist.size=[33, 31]")


def record(out: Path, episodes: int = 3, *more: str) -> Path:
    """A run in which MuJoCo's robot lifts a cube; the images of one camera have odd sides."""
    require_drawing("mujoco")
    with anysim.make("pick_cube", engine="mujoco", overrides=[*SMALL, *more]) as env:
        list(Collector(env, SkillPolicy(env), out, episodes, 0).run())
    return out


def committed(run: Path) -> list[Path]:
    """The trajectories that succeeded."""
    return [path for path in trajectories(run) if open_trajectory(path).manifest.status == "success"]
