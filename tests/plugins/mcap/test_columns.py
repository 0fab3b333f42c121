"""Files encoded from columns: byte for byte those that the writer of the package `mcap` writes frame by frame."""

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from anysim.record.columns import Change, EpisodeColumns
from anysim.record.header import ArrayLayout, EpisodeHeader, Header, RunHeader, StateLayout
from anysim.record.writer import make_writer
from anysim_mcap.wire import varint, varints
from tests.plugins.mcap.frame_by_frame import write_slowly

LAYOUT = StateLayout(
    bodies=("cube", "panda.link0", "a.body.with.a.name.that.takes.a.length.of.two.bytes." * 3),
    action=("a", "b"),
    state={
        "joint_pos": (2,),
        "body_pose": (3, 7),
        "nothing": (0, 3),
        "number": (),
        "hit": (5,),
        "cell": (3,),
        "ids": (4,),
    },
    dtypes={"hit": "bool", "cell": "int8", "ids": "int32", "number": "float32"},
    obs={"policy": ArrayLayout(shape=(3,), dtype="float32"), "privileged": ArrayLayout(shape=(2, 2))},
)
BARE = StateLayout(state={"x": (1,)})


def columns(frames: int, first: int, dt: float, layout: StateLayout = LAYOUT, **words: Any) -> EpisodeColumns:
    """An episode of noise."""
    noise = np.random.default_rng(frames)
    run = RunHeader(
        task="push",
        seed=7,
        engine="null",
        engine_version="1.0",
        world_hash="ab",
        control_dt=0.02,
        layout=layout,
        spec={"seed": 7, "names": ["é"]},
    )
    episode = EpisodeHeader(env=3, episode=2, episode_seed=1 << 70, instruction=words.pop("instruction", ""))
    return EpisodeColumns(
        header=Header(run, episode),
        first_step=first,
        time=dt * (first + np.arange(frames)),
        action=noise.normal(size=(frames, len(layout.action))),
        reward=noise.normal(size=frames),
        state={
            name: (5 * noise.normal(size=(frames, *shape))).astype(layout.dtype(name))
            for name, shape in layout.state.items()
        },
        obs={n: noise.normal(size=(frames, *a.shape)).astype(a.dtype) for n, a in layout.obs.items()},
        status=words.pop("status", (Change(0, "running"),)),
        first_image={},
        annotations=words.pop("annotations", ()),
        language=words.pop("language", ()),
    )


def assert_equal(tmp_path, episode: EpisodeColumns, **options: Any) -> None:
    writer = make_writer("mcap", options)
    writer.prepare(episode.header.run)
    for name in ("one", "two"):  # templates are made for the first and used again for the second
        (tmp_path / name).mkdir()
        writer.write(tmp_path / name, episode, "success")
    write_slowly(tmp_path / "slow.mcap", episode, "success", writer.options)  # pyright: ignore[reportAttributeAccessIssue]
    slow = (tmp_path / "slow.mcap").read_bytes()
    assert (tmp_path / "one/trajectory.mcap").read_bytes() == slow
    assert (tmp_path / "two/trajectory.mcap").read_bytes() == slow


WORDS = {
    "instruction": "push", "status": (Change(0, "running"), Change(7, "truncated"), Change(9, "success")),
    "annotations": (Change(0, {"phase": "reach", "at": [1, 2.5]}), Change(4, {}), Change(9, {"phase": "push"})),
    "language": (Change(4, "pull"), Change(5, "push")),
}  # fmt: skip


@pytest.mark.parametrize("options", [{}, {"compression": "none"}, {"chunk_size": 1024}, {"transforms": False}])
@pytest.mark.parametrize("first", [0, 1])
def test_an_episode_with_words(tmp_path, first, options):
    assert_equal(tmp_path, columns(40, first, 0.02, **WORDS), **options)


@pytest.mark.parametrize("size", [1024, 3333, 20_000, 256 << 10])
def test_steps_of_one_to_three_bytes_and_times_of_minutes_cut_into_chunks(tmp_path, size):
    assert_equal(tmp_path, columns(17_000, 0, 0.005, BARE), chunk_size=size)


def test_a_layout_with_almost_nothing(tmp_path):
    assert_equal(tmp_path, columns(3, 1, 0.0, BARE))


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    frames=st.integers(2, 60),
    first=st.integers(0, 1),
    dt=st.sampled_from([0.001, 1 / 60, 0.02, 0.5, 1000.0]),
    size=st.integers(1024, 40_000),
    rows=st.sets(st.integers(0, 59)),
)
def test_any_episode(tmp_path_factory, frames, first, dt, size, rows):
    at = sorted(row for row in rows if row < frames)
    changes = tuple(Change(row, {"word": "x" * row}) for row in at)
    status = (Change(0, "running"), *(Change(row, f"s{row}") for row in at if row))
    assert_equal(
        tmp_path_factory.mktemp("run"), columns(frames, first, dt, annotations=changes, status=status), chunk_size=size
    )


@given(st.lists(st.integers(0, 2**64 - 1), min_size=1))
def test_varints_of_arrays(values):
    data, lengths = varints(np.array(values, dtype=np.uint64))
    assert [bytes(row[:n]) for row, n in zip(data, lengths, strict=True)] == [varint(value) for value in values]
    _, lengths = varints(np.array([0, 1], dtype=np.uint64), optional=True)
    assert lengths.tolist() == [0, 1]
