import subprocess
import sys

from anysim import registry
from anysim_mcap.reader import McapReader
from anysim_mcap.writer import McapWriter, Options


def test_writer_and_reader_have_one_name():
    assert registry.load("writers", "mcap") is McapWriter
    assert registry.load("readers", McapWriter.name) is McapReader
    assert McapWriter.options_model() is Options


def test_importing_is_light():
    code = (
        "import sys, anysim_recording.recorder, anysim_inspect.verify, anysim_mcap.writer, anysim_mcap.reader;"
        "print(sorted({'av', 'mcap', 'google.protobuf', 'zstandard', 'mujoco', 'trimesh'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "[]\n"
