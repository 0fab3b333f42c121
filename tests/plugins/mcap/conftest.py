"""A run of two robots' worth of bodies without an engine, recorded by the writer `mcap`."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim.record.frame import RecordedFrame
from anysim.record.header import ArrayLayout, CameraInfo, EpisodeHeader, RunHeader, StateLayout
from anysim.record.writer import make_writer
from anysim_recording.recorder import Recorder

LAYOUT = StateLayout(
    bodies=("cube", "panda.link0", "panda.hand"),
    joints=("panda.j1", "panda.j2"),
    actuators=("panda.j1",),
    action=("panda.j1",),
    state={
        "joint_pos": (2,),
        "joint_vel": (2,),
        "body_pose": (3, 7),
        "body_twist": (3, 6),
        "control_position": (1,),
        "contact_force": (0, 3),
    },
    obs={"policy": ArrayLayout(shape=(4,), dtype="float32"), "privileged": ArrayLayout(shape=(2, 2))},
)
CAMERAS = {
    "front": CameraInfo(width=64, height=48, every=2),
    "wrist": CameraInfo(width=31, height=17, every=1, fov=90.0, parent="panda.hand", pose=(0, 0, 0.1, 0, 0, 0, 1)),
}
RUN = RunHeader(
    task="push",
    seed=7,
    engine="null",
    engine_version="1.0",
    world_hash="ab" * 32,
    control_dt=0.02,
    layout=LAYOUT,
    spec={"seed": 7, "engine": {"name": "null"}},
    packages={"numpy": "2.0"},
)


def episode(env: int = 0, number: int = 0, cameras: Any = CAMERAS, instruction: str = "push the cube") -> EpisodeHeader:
    return EpisodeHeader(
        env=env, episode=number, episode_seed=1 << 70, drawn={"mass": 0.1}, instruction=instruction, cameras=cameras
    )


def picture(width: int, height: int, step: int) -> np.ndarray:
    """Left half a red that grows with the step, right half blue."""
    image = np.zeros((height, width, 3), np.uint8)
    image[:, : width // 2, 0] = 40 + 10 * step
    image[:, width // 2 :, 2] = 200
    return image


def frame(step: int, cameras: Any = CAMERAS, **changes: Any) -> RecordedFrame:
    generator = np.random.default_rng(step)
    made = RecordedFrame(
        step=step,
        time=step * 0.02,
        action=None if step == 0 else generator.normal(size=1),
        state={name: generator.normal(size=shape) for name, shape in LAYOUT.state.items()},
        reward=-0.1 * step,
        status="running",
        obs={"policy": generator.normal(size=4).astype(np.float32), "privileged": generator.normal(size=(2, 2))},
        annotations={} if step < 3 else {"skill": "push", "phase": "reach" if step < 6 else "push"},
        language="now pull" if step >= 4 else "",
        images={n: picture(c.width, c.height, step) for n, c in cameras.items() if step % c.every == 0},
    )
    return made._replace(**changes)


@pytest.fixture
def sample() -> Any:
    """This module, for tests that need its parts."""
    return sys.modules[__name__]


@pytest.fixture
def record() -> Callable[..., Path]:
    """Record one trajectory into a run's directory."""

    return recorded


def recorded(out: Path, steps: int = 8, cameras: Any = CAMERAS, first: int = 0, **options: Any) -> Path:
    """Record one trajectory into a run's directory."""
    with Recorder(out, make_writer("mcap", options), RUN) as recorder:
        number = len(recorder.committed())
        recorder.start(episode(number=number, cameras=cameras))
        for step in range(first, steps + 1):
            recorder.append(0, frame(step, cameras))
        return recorder.commit(0, "success").wait()
