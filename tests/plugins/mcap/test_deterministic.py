"""Two processes that record the same frames write the same bytes."""

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = """
import importlib.util, sys, time
from pathlib import Path
spec = importlib.util.spec_from_file_location("sample", sys.argv[1])
sample = sys.modules["sample"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(sample)
import numpy as np
from anysim.record.header import CameraInfo
from anysim_recording.recorder import Recorder
from anysim.record.writer import make_writer
cameras = {**sample.CAMERAS, "wide": CameraInfo(width=320, height=240)}
noise = np.random.default_rng(0)
def picture(camera, step):
    image = sample.picture(camera.width, camera.height, step % 20)
    image[step % camera.height] = noise.integers(0, 255, (camera.width, 3))
    return image
with Recorder(sys.argv[2], make_writer("mcap", {}), sample.RUN) as recorder:
    recorder.start(sample.episode(cameras=cameras))
    for step in range(41):
        recorder.append(0, sample.frame(step % 20)._replace(step=step, time=step * 0.02,
            action=None if step == 0 else sample.frame(1).action,
            images={n: picture(c, step) for n, c in cameras.items() if step % c.every == 0}))
    recorder.commit(0, "success", outcome={"retries": 1}, clock={"host": sys.argv[3]})
"""


# what malloc returns is filled with other bytes, so that a codec that reads memory it has not written is found out
SURROUNDINGS = {
    "one": {"PYTHONHASHSEED": "1", "TZ": "UTC", "MALLOC_PERTURB_": "37"},
    "two": {"PYTHONHASHSEED": "2", "TZ": "Asia/Tokyo", "MALLOC_PERTURB_": "170"},
}


def test_byte_identical_across_processes(tmp_path):
    sample = str(Path(__file__).with_name("conftest.py"))
    directories = []
    for name, environment in SURROUNDINGS.items():
        subprocess.run([sys.executable, "-c", SCRIPT, sample, tmp_path / name, name], check=True, env=environment)
        directories.append(tmp_path / name / "episodes/env_0000_episode_0000")
    names = {path.name for path in directories[0].iterdir()}
    assert names == {"manifest.json", "trajectory.mcap", "front.mp4", "wrist.mp4", "wide.mp4"}
    for name in names - {"manifest.json"}:
        assert (directories[0] / name).read_bytes() == (directories[1] / name).read_bytes(), name
    one, two = (json.loads((path / "manifest.json").read_text()) for path in directories)
    assert (one.pop("clock")["host"], two.pop("clock")["host"]) == ("one", "two")
    assert one == two
    assert (tmp_path / "one/run.json").read_bytes() == (tmp_path / "two/run.json").read_bytes()
