"""A short recorded run with two small cameras, and its trajectories."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import anysim
from anysim.record.names import trajectories
from anysim.record.reader import open_trajectory
from anysim.skills.runner import SkillPolicy
from anysim.testing.engines import require_drawing
from anysim_recording.collector import Collector

SMALL = (
    "record.cameras=[front,wrist]",
    "world.cameras.front.size=[48, 32]",
    "world.cameras.front.channels=[rgb,depth,segmentation]",
    "world.cameras.wrist.size=[33, 31]",
    "record.channels={front: [depth, segmentation]}",
    "record.streams={language: {}}",
)


def record(out: Path, episodes: int = 3, *more: str) -> Path:
    """A run in which MuJoCo's robot lifts a cube; one camera sees depth too, the images of the other have odd sides."""
    require_drawing("mujoco")
    with anysim.make("pick_cube", engine="mujoco", overrides=[*SMALL, *more]) as env:
        list(Collector(env, SkillPolicy(env), out, episodes, 0).run())
    return out


def committed(run: Path) -> list[Path]:
    """The trajectories that succeeded."""
    return [path for path in trajectories(run) if open_trajectory(path).manifest.status == "success"]


def import_torchvision() -> None:
    """Give a torch for processors alone the names of torchvision's operators, where those do not fit: none is used."""
    import torch  # pyright: ignore[reportMissingImports]

    if subprocess.run([sys.executable, "-c", "import torchvision"], capture_output=True, check=False).returncode:
        found = importlib.util.find_spec("torchvision")
        assert found is not None
        text = (Path(str(found.origin)).parent / "_meta_registrations.py").read_text()
        for name in sorted(set(re.findall(r'(?:register_meta\(|torchvision::)"?(\w+)"', text))):
            torch.library.define(f"torchvision::{name}", "() -> ()")
