"""The file opens with nothing of anysim's: the plain MCAP reader and the schemas inside it."""

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from anysim.record.header import StateLayout
from anysim_mcap.blocks import BlockEncoder, Channels
from anysim_mcap.records import MESSAGE_HEAD
from tests.plugins.mcap.test_columns import columns
from tests.plugins.mcap.test_streams import Weather, recorded, values


@pytest.fixture
def reader(tmp_path, record):
    with (record(tmp_path, steps=8) / "trajectory.mcap").open("rb") as file:
        yield make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])


def decoded(reader, topic):
    return [(m.message, m.decoded_message) for m in reader.iter_decoded_messages(topics=[topic])]


def test_topics_schemas_and_counts(reader):
    summary = reader.get_summary()
    counts = {summary.channels[i].topic: n for i, n in summary.statistics.channel_message_counts.items()}
    assert counts == {
        "/action": 8,
        "/state": 9,
        "/collect": 9,
        "/tf": 9,
        "/annotation": 2,
        "/language": 2,
        "/tf_static": 1,
        "/camera/front/calibration": 1,
        "/camera/wrist/calibration": 1,
    }
    schemas = {c.topic: (summary.schemas[c.schema_id].name, c.message_encoding) for c in summary.channels.values()}
    assert schemas["/state"] == ("anysim.State", "protobuf")
    assert schemas["/tf"] == schemas["/tf_static"] == ("foxglove.FrameTransforms", "protobuf")
    assert schemas["/camera/front/calibration"] == ("foxglove.CameraCalibration", "protobuf")
    assert schemas["/annotation"] == ("anysim.Annotation", "json")


def test_log_time_is_simulated_time(reader):
    times = [(m.sequence, m.log_time, m.publish_time) for m, _ in decoded(reader, "/state")]
    assert times == [(step, step * 20_000_000, step * 20_000_000) for step in range(9)]


def test_states_by_the_schema_in_the_file(reader, sample):
    for step, (_, message) in enumerate(decoded(reader, "/state")):
        assert message.step == step
        assert message.time == step * 0.02
        for name, rows in sample.frame(step).state.items():
            assert list(getattr(message, name)) == rows.ravel().tolist()
    for step, (_, message) in enumerate(decoded(reader, "/collect")):
        frame = sample.frame(step)
        assert (message.reward, message.status) == (frame.reward, "running")
        assert list(message.obs_policy) == frame.obs["policy"].tolist()


def test_transforms_are_those_of_the_state(reader, sample):
    for step, (_, message) in enumerate(decoded(reader, "/tf")):
        poses = sample.frame(step).state["body_pose"]
        assert [t.child_frame_id for t in message.transforms] == list(sample.LAYOUT.bodies)
        for transform, pose in zip(message.transforms, poses, strict=True):
            assert transform.parent_frame_id == "world"
            assert transform.timestamp.ToNanoseconds() == step * 20_000_000
            p, q = transform.translation, transform.rotation
            assert [p.x, p.y, p.z, q.x, q.y, q.z, q.w] == pose.tolist()


def test_transforms_are_encoded_as_the_library_would():
    times = [0, 1, 999_999_999, 1_000_000_000, 1_020_000_000, 128_000_000_000, 1 << 53]
    names = ("a", "a much longer name of a body " * 6, "ünïcode")
    layout = StateLayout(bodies=names, state={"body_pose": (3, 7)})
    episode = columns(len(times), 1, 0.02, layout)
    episode = replace(episode, time=np.array(times) / 1e9)
    data = b"".join(b.data.tobytes() for b in BlockEncoder(layout, Channels(1, 2, 3, 4, 5, 6)).encode(episode))
    found, at = [], 0
    while at < len(data):
        _, length, channel, _, time, _ = MESSAGE_HEAD.unpack_from(data, at)
        if channel == 6:
            found.append((time, data[at + MESSAGE_HEAD.size : at + 9 + length]))
        at += 9 + length
    assert [time for time, _ in found] == times
    for (time, content), poses in zip(found, episode.state["body_pose"], strict=True):
        message = FrameTransforms.FromString(content)
        assert content == message.SerializeToString()
        assert [t.child_frame_id for t in message.transforms] == list(names)
        assert {t.timestamp.ToNanoseconds() for t in message.transforms} == {time}
        numbers = [
            [getattr(part, axis) for part, axes in ((t.translation, "xyz"), (t.rotation, "xyzw")) for axis in axes]
            for t in message.transforms
        ]
        assert numbers == poses.tolist()


def test_cameras(reader):
    ((_, placed),) = decoded(reader, "/tf_static")
    places = {t.child_frame_id: t for t in placed.transforms}
    assert places["camera/wrist"].parent_frame_id == "panda.hand"
    assert places["camera/wrist"].translation.z == 0.1
    ((_, wrist),) = decoded(reader, "/camera/wrist/calibration")
    assert CameraCalibration.FromString(wrist.SerializeToString()).frame_id == "camera/wrist"
    assert (wrist.width, wrist.height) == (31, 17)
    # 90 degrees from top to bottom: the focal length is half the height
    np.testing.assert_allclose(list(wrist.K), [8.5, 0, 15.5, 0, 8.5, 8.5, 0, 0, 1])


def test_words_follow_their_json_schemas(reader):
    summary = reader.get_summary()
    seen = {}
    for schema, channel, message in reader.iter_messages(topics=["/annotation", "/language"]):
        assert schema.encoding == "jsonschema"
        data = json.loads(message.data)
        jsonschema.validate(data, json.loads(schema.data))
        seen.setdefault(channel.topic, []).append((data["step"], data.get("text", data.get("annotations"))))
    assert seen["/language"] == [(0, "push the cube"), (4, "now pull")]
    assert seen["/annotation"] == [(3, {"phase": "reach", "skill": "push"}), (6, {"phase": "push", "skill": "push"})]
    assert summary.statistics.attachment_count == 1


def test_facts_without_the_manifest(reader):
    facts = {record.name: record.metadata for record in reader.iter_metadata()}
    assert facts["anysim/outcome"] == {"status": "success", "steps": "8"}
    assert facts["anysim/trajectory"]["episode_seed"] == str(1 << 70)
    assert json.loads(facts["anysim/names"]["joints"]) == ["panda.j1", "panda.j2"]
    (spec,) = reader.iter_attachments()
    assert (spec.name, spec.media_type) == ("spec.json", "application/json")
    assert json.loads(spec.data) == {"seed": 7, "engine": {"name": "null"}}
    assert reader.get_header().library == "anysim-mcap 0.1.0"


def test_streams_by_the_schemas_in_their_file(tmp_path, sample):
    path = recorded(tmp_path, sample, Weather())
    kinds = {"rain": "array", "wet": "array", "range": "image", "map": "image", "picture": "image", "drops": "points"}
    kinds |= {"report": "text", "none/of/it": "data", "boxes": "data"}
    names = {"array": "anysim.Array", "image": "foxglove.RawImage", "points": "foxglove.PointCloud"}
    names |= {"text": "foxglove.Log", "data": "anysim.Data"}
    schemas = {f"/weather/{name}": names[kind] for name, kind in kinds.items()}
    with (path / "weather.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary is not None
        assert {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()} == schemas
        for topic, schema in schemas.items():
            if schema == "anysim.Data":
                for _, channel, message in reader.iter_messages(topics=[topic]):
                    found = summary.schemas[channel.schema_id]
                    jsonschema.validate(json.loads(message.data), json.loads(found.data))
                continue
            messages = decoded(reader, topic)
            assert [m.log_time for m, _ in messages] == [40_000_000 * k for k in range(4)]
            for row, (_, message) in enumerate(messages):
                value = values(2 * row)[topic[1:]]
                if schema == "foxglove.Log":
                    assert message.message == value
                else:
                    assert message.data == value.tobytes()
                if schema == "foxglove.RawImage":
                    assert (message.height, message.width, message.step) == (3, 4, value.strides[0])
