"""Readers of damaged and hostile files: a sentence, never a crash, never much memory."""

import json
import shutil
import struct

import numpy as np
import pytest

from anysim.errors import RecordError
from anysim.record.reader import open_trajectory
from anysim.record.verify import verify
from anysim_mcap.chunks import records
from anysim_mcap.reader import McapReader


@pytest.fixture
def trajectory(tmp_path, record):
    return record(tmp_path, steps=8)


def test_verify_finds_each_kind_of_damage(trajectory, tmp_path):
    for name in ("trajectory.mcap", "front.mp4"):
        copy = shutil.copytree(trajectory, tmp_path / name / trajectory.name)
        data = bytearray((copy / name).read_bytes())
        data[len(data) // 2] ^= 4
        (copy / name).write_bytes(data)
        assert verify(copy) == [f"{copy / name} was changed after its commit (its SHA-256 differs)"]
        (copy / name).unlink()
        (copy / "extra.bin").write_bytes(b"")
        assert verify(copy) == [f"{copy} lacks {name}", f"{copy} has files that its manifest doesn't know: extra.bin"]


def test_a_flipped_bit_is_found_by_the_checksums_of_the_file(trajectory):
    file = trajectory / "trajectory.mcap"
    data = file.read_bytes()
    generator = np.random.default_rng(0)
    end = data.rindex(bytes([0x0F]) + struct.pack("<Q", 4))  # the record that ends the data, and its checksum
    for position in generator.integers(0, end, 60):
        flipped = bytearray(data)
        flipped[position] ^= 1 << int(generator.integers(8))
        file.write_bytes(flipped)
        with pytest.raises(RecordError):
            list(records(file))


def test_a_truncated_file(trajectory):
    file = trajectory / "trajectory.mcap"
    data = file.read_bytes()
    for length in (0, 5, 8, 100, len(data) // 2, len(data) - 1):
        file.write_bytes(data[:length])
        with pytest.raises(RecordError, match=r"trajectory\.mcap"):
            _ = open_trajectory(trajectory).actions
    file.write_bytes(data[: len(data) // 2])
    with pytest.raises(RecordError, match=r"it was truncated, or never finished|is damaged"):
        _ = open_trajectory(trajectory).actions


def test_claimed_sizes_take_no_memory(trajectory):
    file = trajectory / "trajectory.mcap"
    magic = file.read_bytes()[:8]
    huge = struct.pack("<BQ", 0x06, 1 << 62)
    attachment = struct.pack("<BQQQII", 0x09, 60, 0, 0, 0, 0) + struct.pack("<Q", 1 << 61)
    for content in (magic + huge, magic + attachment, magic + struct.pack("<BQI", 0x01, 20, 0xFFFFFFFF) + b"abc"):
        file.write_bytes(content)
        with pytest.raises(RecordError, match=r"damaged|truncated"):
            list(records(file))


def test_a_compression_bomb(trajectory):
    import zstandard
    from mcap.data_stream import RecordBuilder
    from mcap.records import Chunk

    file = trajectory / "trajectory.mcap"
    magic = file.read_bytes()[:8]
    packed = zstandard.compress(bytes(200 << 20))
    for claimed in (200 << 20, 100):
        builder = RecordBuilder()
        Chunk("zstd", packed, 0, 0, 0, claimed).write(builder)
        file.write_bytes(magic + builder.end())
        with pytest.raises(RecordError, match="a chunk of 209715200 bytes claims"):
            list(records(file))


def edit(trajectory, change):
    file = trajectory / "manifest.json"
    data = json.loads(file.read_text())
    change(data)
    file.write_text(json.dumps(data))
    return McapReader(trajectory)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.update(steps=7), "the manifest says 7 steps"),
        (lambda d: d.update(steps=9), "the manifest says 9 steps"),
        (lambda d: d.update(steps=1 << 50), "the manifest says"),
        (lambda d: d.update(has_initial_frame=False), "inconsistent: /state"),
        (lambda d: d["layout"]["state"].update(joint_pos=[3]), r"joint_pos has 2 numbers; the manifest says \(3,\)"),
        (lambda d: d["layout"]["state"].update(mass=[1]), r"mass has 0 numbers"),
        (lambda d: d["layout"].update(action=["a", "b"]), r"/action has 1 numbers"),
        (lambda d: d["layout"]["obs"]["policy"].update(shape=[2]), r"policy has 4 numbers"),
    ],
)
def test_a_manifest_that_contradicts_the_file(trajectory, change, message):
    reader = edit(trajectory, change)
    with pytest.raises(RecordError, match=message):
        _ = reader.actions
    assert any("inconsistent" in fault for fault in verify(trajectory))


def test_digests_tie_the_content_to_the_manifest(trajectory):
    edit(trajectory, lambda d: d.update(final_digest="0" * 64, initial_digest="1" * 64))
    assert [fault.split(": ")[1] for fault in verify(trajectory)] == [
        "the last state is not the one that the manifest describes",
        "the initial state is not the one that the manifest describes",
    ]


def test_frame_counts_and_sizes_of_videos(trajectory):
    edit(trajectory, lambda d: d["cameras"]["front"].update(frames=6))
    assert verify(trajectory) == [f"{trajectory / 'front.mp4'} has 5 frames; the manifest says 6"]
    edit(trajectory, lambda d: d["cameras"]["front"].update(frames=5, width=640))
    (fault,) = verify(trajectory)
    assert "should hold one video of 640 x 48 pixels; it holds 64 x 48" in fault


def test_a_video_that_is_none(trajectory):
    (trajectory / "front.mp4").write_bytes(b"not a video" * 100)
    reader = open_trajectory(trajectory)
    with pytest.raises(RecordError, match=r"front\.mp4 does not decode"):
        list(reader.images("front"))
    assert any("cannot be read as a video" in fault for fault in reader.faults())
