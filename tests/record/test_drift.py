import numpy as np
import pytest

from anysim.errors import RecordError
from anysim.record.replay import compare_states
from anysim_inspect.replay_summary import summarise


def states(steps=5):
    generator = np.random.default_rng(0)
    return {"joint_pos": generator.normal(size=(steps, 3)), "body_pose": generator.normal(size=(steps, 2, 7))}


def test_equal_bits():
    drift = compare_states(states(), states())
    assert drift.identical
    assert drift.first_step is None
    assert str(drift) == "identical, bit for bit, over 5 steps"


def test_the_last_bit_counts():
    other = states()
    other["joint_pos"][2, 1] = np.nextafter(other["joint_pos"][2, 1], 9.0)
    drift = compare_states(states(), other)
    assert not drift.identical
    assert drift.fields["body_pose"].identical
    field = drift.fields["joint_pos"]
    assert field.first_step == drift.first_step == 3
    assert 0 < field.max_abs < 1e-15


def test_minus_zero_is_not_zero():
    drift = compare_states({"a": np.zeros((2, 1))}, {"a": np.array([[0.0], [-0.0]])})
    assert drift.fields["a"] == (False, 2, 0.0, 1)


def test_the_largest_difference_and_where():
    other = states()
    other["joint_pos"][1] += 0.1
    other["joint_pos"][3, 0] -= 0.5
    field = compare_states(states(), other).fields["joint_pos"]
    assert (field.first_step, field.max_step) == (2, 4)
    assert field.max_abs == pytest.approx(0.5)


def test_opposite_quaternions_are_the_same_rotation():
    other = states()
    other["body_pose"][..., 3:] *= -1
    field = compare_states(states(), other).fields["body_pose"]
    assert (field.identical, field.first_step, field.max_abs) == (False, 1, 0.0)


def test_what_is_not_finite_differs_without_bound():
    other = states()
    other["joint_pos"][4, 0] = np.nan
    field = compare_states(states(), other).fields["joint_pos"]
    assert (field.first_step, field.max_abs, field.max_step) == (5, np.inf, 5)


def test_a_shorter_replay():
    drift = compare_states(states(5), {name: array[:3] for name, array in states(5).items()})
    assert all(field.identical for field in drift.fields.values())
    assert not drift.identical
    assert drift.first_step == 4
    assert str(drift) == "differs from step 4 on (of 5 recorded, 3 replayed)"


def test_another_world():
    with pytest.raises(RecordError, match="different arrays: body_pose, joint_pos and joint_pos"):
        compare_states(states(), {"joint_pos": states()["joint_pos"]})
    with pytest.raises(RecordError, match=r"'joint_pos' was recorded as \(3,\) and replayed as \(4,\)"):
        compare_states(states(), {**states(), "joint_pos": np.zeros((5, 4))})


def test_a_summary_finds_the_worst_of_many_replays():
    drifts = {}
    for name, shift in (("a", 0.0), ("b", 0.3), ("c", 0.1)):
        other = states()
        other["joint_pos"][3:] += shift
        drifts[name] = compare_states(states(), other)
    pose, joints = summarise(drifts)
    assert (pose.name, pose.identical, pose.first_step, pose.worst) == ("body_pose", 3, None, 0.0)
    assert (joints.name, joints.identical, joints.first_step, joints.worst_replay) == ("joint_pos", 1, 4, "b")
    assert joints.worst == pytest.approx(0.3)
    assert joints.median == pytest.approx(0.1)
