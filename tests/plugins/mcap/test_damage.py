"""Readers of damaged and hostile files: a sentence, never a crash, never much memory."""

import hashlib
import json
import re
import shutil
import struct
from dataclasses import replace

import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from mcap.records import Channel, Message, Schema

from anysim.errors import RecordError
from anysim.record.columns import Change, ColumnStore, EpisodeColumns
from anysim.record.header import Header
from anysim.record.reader import open_trajectory
from anysim.record.writer import make_writer
from anysim_inspect.verify import verify
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
    (lens, fault) = verify(trajectory)
    assert lens.endswith("/camera/front/calibration is not the lens of that camera in the manifest")
    assert "should hold one video of 640 x 48 pixels; it holds 64 x 48" in fault


def test_a_video_that_is_none(trajectory):
    (trajectory / "front.mp4").write_bytes(b"not a video" * 100)
    reader = open_trajectory(trajectory)
    with pytest.raises(RecordError, match=r"front\.mp4 cannot be read as a video"):
        list(reader.images("front"))
    assert any("cannot be read as a video" in fault for fault in reader.faults())


def sealed(directory):
    """Make the hashes of all files right."""

    def change(manifest):
        for name in manifest["files"]:
            data = (directory / name).read_bytes()
            manifest["files"][name] = {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}

    edit(directory, change)


def test_a_damaged_frame_is_named_though_the_hashes_are_right(trajectory):
    file = trajectory / "front.mp4"
    good = file.read_bytes()
    start = good.rindex(b"mdat") + 4
    kept = start + 3 * (len(good) - start) // 4  # the first frame is the largest, and whole
    file.write_bytes(good[:kept] + bytes(len(good) - kept))
    sealed(trajectory)
    (fault,) = verify(trajectory)
    assert re.search(r"front\.mp4: frame \d+(, or one soon after it, does not decode| is damaged)", fault)
    with pytest.raises(RecordError, match="frame"):
        list(open_trajectory(trajectory).images("front"))
    file.write_bytes(good)
    sealed(trajectory)
    assert verify(trajectory) == []


def test_a_video_of_another_codec_or_rate_is_none_of_ours(trajectory, sample):
    import av

    edit(trajectory, lambda d: d["cameras"]["front"].update(fps=10.0))
    (fault,) = verify(trajectory)
    assert "frame 1 is at 0.04 s, and should be at 0.1 s" in fault
    with av.open(str(trajectory / "front.mp4"), "w", format="mp4") as container:
        stream = container.add_stream("mpeg4", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        frame = av.VideoFrame.from_ndarray(sample.picture(64, 48, 0), format="rgb24")
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    sealed(trajectory)
    (fault,) = verify(trajectory)
    assert "should be encoded in h264; it is in mpeg4" in fault


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c.state["joint_pos"].__setitem__((3, 0), np.nan), "the state 'joint_pos' are not finite at step 3"),
        (lambda c: c.action.__setitem__(2, np.inf), "the actions are not finite at step 2"),
        (lambda c: c.reward.__setitem__(8, -np.inf), "the rewards are not finite at step 8"),
        (lambda c: c.time.__setitem__(4, 0.01), "time goes back at step 4"),
    ],
)
def test_nonsense_in_a_file_that_can_be_read(trajectory, sample, tmp_path, change, says):
    """Numbers that no recorder writes, in a file whose own checksums and whose hash are right."""
    store = ColumnStore(sample.LAYOUT, 9)
    frames = [sample.frame(step) for step in range(9)]
    for row, f in enumerate(frames):
        values = {("time", ""): np.array([f.time]), ("reward", ""): np.array([f.reward])}
        values[("action", "")] = np.zeros((1, 1)) if f.action is None else f.action[None]
        values |= {("state", k): v[None] for k, v in f.state.items()} | {("obs", k): v[None] for k, v in f.obs.items()}
        store.write(np.array([store.open() if row == 0 else 0]), np.array([row]), values)
    taken = store.take(0, 9)
    parts = {kind: {k: v for (what, k), v in taken.items() if what == kind} for kind in ("state", "obs")}
    columns = EpisodeColumns(
        Header(sample.RUN, sample.episode()),
        0,
        taken["time", ""],
        taken["action", ""],
        parts["state"],
        taken["reward", ""],
        parts["obs"],
        (Change(0, "running"),),
        (),
        (),
        {},
    )
    change(columns)
    writer = make_writer("mcap", {})
    writer.prepare(sample.RUN)
    (trajectory / "trajectory.mcap").unlink()
    writer.write(trajectory, columns, "success")
    sealed(trajectory)
    (fault,) = verify(trajectory)
    assert says in fault


def test_the_file_names_the_run_that_the_manifest_names(trajectory):
    change = {"world_hash": "cd" * 32, "episode_seed": 5}
    manifest = trajectory / "manifest.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | change))
    [fault] = verify(trajectory)
    assert fault == f"{trajectory / 'trajectory.mcap'} says another episode_seed, world_hash than the manifest"


def test_a_message_that_is_logged_at_another_time(trajectory, monkeypatch):
    def late(path):
        for record in records(path):
            if getattr(record, "sequence", None) == 3:
                record.log_time += 1
            yield record

    monkeypatch.setattr("anysim_mcap.reader.records", late)
    [fault] = verify(trajectory)
    assert fault.endswith("step 3 of /action, at 0.06 s, is logged at 60000001 ns")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda m: m.transforms[1].translation.__setattr__("x", 9.0), "the transforms of step 3 are not those of its"),
        (lambda m: m.transforms[1].rotation.__setattr__("w", 9.0), "the transforms of step 3 are not those of its"),
        (
            lambda m: m.transforms[0].__setattr__("child_frame_id", "cup"),
            "the transforms of step 3 are not those of its",
        ),
        (lambda m: m.transforms[0].__setattr__("parent_frame_id", "cup"), "the transforms of step 3 are not those of"),
        (lambda m: m.transforms[2].timestamp.__setattr__("nanos", 1), "the transforms of step 3 are not those of its"),
        (lambda m: m.transforms.pop(), "the transforms of step 3 are not those of its state"),
    ],
)
def test_transforms_that_contradict_the_states(trajectory, monkeypatch, change, says):
    fault = rewritten(trajectory, monkeypatch, FrameTransforms, change, lambda record: record.sequence == 3)
    assert says in fault


def test_lenses_and_places_that_contradict_the_manifest(trajectory, monkeypatch):
    fault = rewritten(
        trajectory, monkeypatch, CameraCalibration, lambda m: m.K.__setitem__(0, 5.0), lambda record: True
    )
    assert fault.endswith("/camera/front/calibration is not the lens of that camera in the manifest")

    def moved(message):
        message.transforms[1].translation.z += 1.0

    fault = rewritten(trajectory, monkeypatch, FrameTransforms, moved, lambda record: record.log_time == 0)
    assert fault.endswith("camera/wrist is not where the manifest has that camera")


def test_steps_without_transforms_where_others_have_them(trajectory, monkeypatch, tmp_path, record):
    fault = rewritten(trajectory, monkeypatch, FrameTransforms, None, lambda record: record.sequence == 4)
    assert fault.endswith("8 steps have transforms, 9 have states")
    assert verify(record(tmp_path / "bare", steps=8, transforms=False)) == []
    assert verify(record(tmp_path / "late", steps=8, first=1, cameras={})) == []


def rewritten(trajectory, monkeypatch, kind, change, where):
    """The one fault of a file in which the messages of a kind are changed, or left out."""

    def told(path):
        schemas, channels = {}, {}
        for found in records(path):
            if isinstance(found, Schema):
                schemas[found.id] = found.name
            elif isinstance(found, Channel):
                channels[found.id] = schemas[found.schema_id]
            elif (
                isinstance(found, Message) and channels[found.channel_id] == kind.DESCRIPTOR.full_name and where(found)
            ):
                if change is None:
                    continue
                message = kind.FromString(found.data)
                change(message)
                found = replace(found, data=message.SerializeToString())
            yield found

    with monkeypatch.context() as now:
        now.setattr("anysim_mcap.drawn_faults.records", told)
        [fault] = verify(trajectory)
    return fault
