import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from anysim.errors import RecordError
from anysim.record.frame import RecordedFrame
from anysim.record.header import ArrayLayout, EpisodeHeader, RunHeader, StateLayout
from anysim.record.reader import open_trajectory
from anysim.record.writer import make_writer
from anysim_inspect.verify import verify
from anysim_recording.recorder import Recorder


def same_bits(a, b):
    return a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes()


def test_everything_comes_back(tmp_path, record, sample):
    final = record(tmp_path, steps=8)
    assert verify(final) == []
    reader = open_trajectory(final)
    frames = [sample.frame(step) for step in range(9)]
    assert same_bits(reader.actions, np.stack([f.action for f in frames[1:]]))
    assert same_bits(reader.times, np.array([f.time for f in frames[1:]]))
    assert same_bits(reader.rewards, np.array([f.reward for f in frames[1:]]))
    assert list(reader.states) == sorted(sample.LAYOUT.state)
    for name in sample.LAYOUT.state:
        assert same_bits(reader.states[name], np.stack([f.state[name] for f in frames[1:]]))
        assert same_bits(reader.initial_state[name], frames[0].state[name])
    for name in ("policy", "privileged"):
        assert same_bits(reader.obs[name], np.stack([f.obs[name] for f in frames[1:]]))
        assert same_bits(reader.initial_obs[name], frames[0].obs[name])
    assert reader.statuses == ("running",) * 8
    assert reader.annotations == tuple(f.annotations for f in frames[1:])
    assert reader.language == ("push the cube",) * 3 + ("now pull",) * 5
    assert reader.manifest.episode_seed == 1 << 70


def test_without_an_initial_frame(tmp_path, record, sample):
    reader = open_trajectory(record(tmp_path, first=1, steps=3, cameras={}))
    assert reader.initial_state == {}
    assert reader.initial_obs == {}
    assert same_bits(reader.states["joint_pos"], np.stack([sample.frame(s).state["joint_pos"] for s in (1, 2, 3)]))
    assert reader.language == ("push the cube",) * 3


@pytest.mark.parametrize("options", [{"compression": "none"}, {"chunk_size": 1024}, {"transforms": False}])
def test_options_change_nothing_that_is_read(tmp_path, record, options):
    plain, other = record(tmp_path / "a", cameras={}), record(tmp_path / "b", cameras={}, **options)
    assert (plain / "trajectory.mcap").read_bytes() != (other / "trajectory.mcap").read_bytes()
    assert verify(other) == []
    a, b = open_trajectory(plain), open_trajectory(other)
    assert all(same_bits(a.states[name], b.states[name]) for name in a.states)
    assert a.annotations == b.annotations


def test_a_robot_without_channels_has_empty_actions(tmp_path):
    layout = StateLayout(action=(), state={"x": (1,)})
    run = RunHeader(task="t", seed=0, engine="e", engine_version="1", world_hash="w", control_dt=0.01, layout=layout)
    with Recorder(tmp_path, make_writer("mcap", {}), run) as recorder:
        recorder.start(EpisodeHeader(env=0, episode=0, episode_seed=1))
        for step in (1, 2, 3):
            recorder.append(0, RecordedFrame(step, 0.0, np.zeros(0), {"x": np.full(1, float(step))}, reward=0.0))
        reader = open_trajectory(recorder.commit(0, "success").wait())
    assert reader.actions.shape == (3, 0)


def test_number_types_come_back(tmp_path):
    types = {"bit": "bool", "byte": "uint8", "cell": "int8", "id": "int32", "single": "float32", "double": "float64"}
    layout = StateLayout.model_validate({"state": {name: (2, 2) for name in types}, "dtypes": types})
    run = RunHeader(task="t", seed=0, engine="e", engine_version="1", world_hash="w", control_dt=0.01, layout=layout)
    values = np.array([[0, 1], [120, 255]])
    state = {name: values.astype(kind) for name, kind in types.items()}
    with Recorder(tmp_path, make_writer("mcap", {}), run) as recorder:
        recorder.start(EpisodeHeader(env=0, episode=0, episode_seed=1))
        for step in (0, 1, 2):
            recorder.append(0, RecordedFrame(step, 0.01 * step, np.zeros(0) if step else None, state))
        path = recorder.commit(0, "success").wait()
    reader = open_trajectory(path)
    assert verify(path) == []
    for name, array in state.items():
        assert same_bits(reader.states[name], np.stack([array, array]))
        assert same_bits(reader.initial_state[name], array)


finite = hnp.arrays(np.float64, (6, 5), elements=st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=True))
loose = hnp.arrays(np.float32, (6, 2), elements=st.floats(width=32, allow_nan=False))


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(values=finite, obs=loose, seed=st.integers(0, 1 << 80))
def test_every_finite_float_comes_back_bit_for_bit(tmp_path_factory, values, obs, seed):
    layout = StateLayout(action=("u",), state={"x": (5,)}, obs={"o": ArrayLayout(shape=(2,), dtype="float32")})
    run = RunHeader(task="t", seed=0, engine="e", engine_version="1", world_hash="w", control_dt=0.01, layout=layout)
    with Recorder(tmp_path_factory.mktemp("run"), make_writer("mcap", {}), run) as recorder:
        recorder.start(EpisodeHeader(env=0, episode=0, episode_seed=seed))
        for i, row in enumerate(values):
            recorder.append(0, RecordedFrame(i + 1, 0.0, row[:1], {"x": row}, reward=float(row[4]), obs={"o": obs[i]}))
        reader = open_trajectory(recorder.commit(0, "success").wait())
    assert same_bits(reader.states["x"], values)
    assert same_bits(reader.actions, np.ascontiguousarray(values[:, :1]))
    assert same_bits(reader.rewards, np.ascontiguousarray(values[:, 4]))
    assert same_bits(reader.obs["o"], obs)


@pytest.mark.parametrize("value", [5e-324, -0.0, 1.7976931348623157e308, -2.2250738585072014e-308])
def test_extreme_numbers(tmp_path, sample, value):
    with Recorder(tmp_path, make_writer("mcap", {}), sample.RUN) as recorder:
        recorder.start(sample.episode(cameras={}))
        state = {name: np.full(shape, value) for name, shape in sample.LAYOUT.state.items()}
        recorder.append(0, sample.frame(1, {}, state=state, action=np.array([value]), reward=value))
        reader = open_trajectory(recorder.commit(0, "success").wait())
    for array in (*reader.states.values(), reader.actions, reader.rewards):
        assert same_bits(array, np.full(array.shape, value))


def test_observations_may_be_infinite(tmp_path, sample):
    obs = {"policy": np.array([np.inf, -np.inf, np.nan, -0.0], np.float32), "privileged": np.zeros((2, 2))}
    with Recorder(tmp_path, make_writer("mcap", {}), sample.RUN) as recorder:
        recorder.start(sample.episode(cameras={}))
        recorder.append(0, sample.frame(1, {}, obs=obs))
        reader = open_trajectory(recorder.commit(0, "success").wait())
    np.testing.assert_array_equal(reader.obs["policy"][0], obs["policy"])


def test_a_state_that_is_not_finite_is_refused(tmp_path, sample):
    frame = sample.frame(1, {})
    frame.state["joint_vel"][1] = np.nan
    with Recorder(tmp_path, make_writer("mcap", {}), sample.RUN) as recorder:
        recorder.start(sample.episode(env=2, cameras={}))
        recorder.append(2, frame)
        with pytest.raises(RecordError, match=r"env 2, episode 0, step 1: joint_vel\[1\] is nan; .*discard"):
            recorder.commit(2, "success")
        assert recorder.open_envs == ()


def test_wrong_options_are_explained():
    with pytest.raises(RecordError, match=r"options of the writer mcap: .*\n?crff"):
        make_writer("mcap", {"crff": 3})
