"""The solver as skills see it: it finds what can be reached, says what cannot, and a row's answer is its own."""

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from anysim import registry
from anysim.errors import AnysimError
from anysim.kinematics.chain import Chain
from anysim.math import pose as P
from anysim.model.world import JointType
from anysim.planning.api import IkResult, inverse_kinematics
from anysim.testing.arms import Link, panda_arm, serial_arm
from anysim_control.batch.planner import SHARED_FROM, NumbaIk

ROOT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def panda() -> NumbaIk:
    return NumbaIk(Chain.from_world(panda_arm(), "panda", "arm", "tool"))


def solver(*links: Link, tool: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> NumbaIk:
    world = serial_arm(links, (tool, (0.0, 0.0, 0.0)))
    return NumbaIk(Chain.from_world(world, "robot", "arm", "tool"))


def reachable(chain: Chain, n: int, seed: int) -> dict[str, Any]:
    """n problems that have a solution, with seeds that are anywhere, for bases that are anywhere."""
    rng = np.random.default_rng(seed)
    base = np.concatenate([rng.uniform(-2, 2, (n, 3)), P.normalize(rng.normal(size=(n, 4)))], axis=1)
    goals = rng.uniform(chain.lower, chain.upper, (n, len(chain)))
    return {
        "targets": chain.tool_pose(base, goals),
        "base": base,
        "seeds": rng.uniform(chain.lower, chain.upper, (n, len(chain))),
        "rng_seeds": rng.integers(0, 2**63, n).astype(np.uint64),
    }


def check(ik: NumbaIk, asked: dict[str, Any], result: IkResult) -> None:
    """The answer says the truth about itself and stays within the limits."""
    chain = ik.chain
    poses = chain.tool_pose(asked["base"], result.joint_pos)
    distance = P.norm(poses[:, :3] - asked["targets"][:, :3])
    angle = P.angle_between(poses[:, 3:], asked["targets"][:, 3:])
    np.testing.assert_allclose(result.position_error, distance, atol=1e-12)
    np.testing.assert_allclose(result.rotation_error, angle, atol=1e-7)
    assert (result.joint_pos >= chain.lower).all()
    assert (result.joint_pos <= chain.upper).all()
    assert (result.converged == ((result.position_error < 1e-4) & (result.rotation_error < 1e-4))).all()


def test_it_is_the_registered_planner() -> None:
    assert registry.load("planners", "numba_ik") is NumbaIk


def test_all_of_200_reachable_poses_are_solved_from_random_seeds(panda: NumbaIk) -> None:
    asked = reachable(panda.chain, 200, 0)
    result = panda.solve(**asked, random_restarts=50)
    assert result.converged.sum() == 200
    check(panda, asked, result)


def test_a_near_seed_needs_few_iterations_and_stays_near(panda: NumbaIk) -> None:
    asked = reachable(panda.chain, 200, 1)
    goals = panda.solve(**asked, random_restarts=50).joint_pos
    asked["seeds"] = goals + np.random.default_rng(1).uniform(-0.05, 0.05, goals.shape)
    result = panda.solve(**asked, random_restarts=0)
    check(panda, asked, result)
    assert result.converged.mean() > 0.99
    assert np.median(result.iterations) <= 3
    assert np.abs(result.joint_pos - asked["seeds"])[result.converged].max() < 0.3


def test_a_seed_at_the_solution_is_returned_as_it_is(panda: NumbaIk) -> None:
    q = panda.chain.initial[None]
    result = panda.solve(
        panda.chain.tool_pose(ROOT[None], q), ROOT[None], q, random_restarts=3, rng_seeds=np.zeros(1, np.uint64)
    )
    assert result.iterations[0] == 0
    assert (result.joint_pos == q).all()


def same_bits(a: IkResult, b: IkResult) -> bool:
    return all(x.tobytes() == y.tobytes() for x, y in zip(a, b, strict=True))


def rows(asked: dict[str, Any], which: Any) -> dict[str, Any]:
    return {name: array[which] for name, array in asked.items()}


def test_a_row_is_the_same_bits_in_any_batch_order_and_number_of_threads(panda: NumbaIk) -> None:
    n = SHARED_FROM + 17
    asked = reachable(panda.chain, n, 2)
    asked["targets"][::7, 2] += 3.0  # some that use up all restarts
    together = NumbaIk(panda.chain, threads=1).solve(**asked, random_restarts=5)
    for threads in (2, 3):
        assert same_bits(NumbaIk(panda.chain, threads=threads).solve(**asked, random_restarts=5), together)
    assert not [t.name for t in threading.enumerate() if t.name.startswith("numba_ik")]
    order = np.random.default_rng(3).permutation(n)
    shuffled = panda.solve(**rows(asked, order), random_restarts=5)
    assert same_bits(shuffled, IkResult(*(array[order] for array in together)))
    for i in range(n):
        part = slice(i, i + 1)
        alone = panda.solve(**rows(asked, part), random_restarts=5)
        assert same_bits(alone, IkResult(*(array[part] for array in together)))


def test_one_solver_serves_several_threads(panda: NumbaIk) -> None:
    asked = reachable(panda.chain, 60, 17)
    expected = panda.solve(**asked, random_restarts=5)
    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(lambda _: panda.solve(**asked, random_restarts=5), range(16)))
    assert all(same_bits(answer, expected) for answer in answers)


def test_the_random_starts_of_a_row_come_from_its_own_seed(panda: NumbaIk) -> None:
    asked = {name: np.repeat(array, 20, axis=0) for name, array in reachable(panda.chain, 1, 4).items()}
    asked["seeds"] = np.tile(panda.chain.upper, (20, 1))
    asked["targets"][:, 2] += 3.0
    asked["rng_seeds"] = np.arange(20, dtype=np.uint64) // 2
    found = panda.solve(**asked, random_restarts=10).joint_pos
    assert (found[::2] == found[1::2]).all()
    assert len(np.unique(found[::2], axis=0)) > 5


def test_more_restarts_never_make_an_answer_worse(panda: NumbaIk) -> None:
    asked = reachable(panda.chain, 100, 5)
    counts = [int(panda.solve(**asked, random_restarts=r).converged.sum()) for r in (0, 2, 10, 50)]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]


def test_what_cannot_be_reached_is_reported_with_the_nearest_found(panda: NumbaIk) -> None:
    asked = reachable(panda.chain, 30, 6)
    asked["targets"][:, :3] = asked["base"][:, :3] + np.array([3.0, 0.0, 0.0])
    result = panda.solve(**asked, random_restarts=10)
    assert not result.converged.any()
    assert all(np.isfinite(array).all() for array in result)
    check(panda, asked, result)
    assert (result.position_error > 1.5).all()
    assert (result.position_error < 3.0).all()


def test_absurd_targets_give_finite_joint_positions(panda: NumbaIk) -> None:
    asked = reachable(panda.chain, 2, 7)
    asked["targets"][0, :3] = 1e200
    asked["targets"][1, :3] = 1e9
    result = panda.solve(**asked, random_restarts=3)
    assert not result.converged.any()
    assert np.isfinite(result.joint_pos).all()


def test_a_seed_beyond_the_limits_is_brought_back(panda: NumbaIk) -> None:
    asked = reachable(panda.chain, 20, 8)
    asked["seeds"][:] = 9.0
    result = panda.solve(**asked, random_restarts=50)
    assert result.converged.all()
    check(panda, asked, result)


def test_a_solution_beyond_the_limits_is_none(panda: NumbaIk) -> None:
    q = panda.chain.initial[None] + np.array([[0.0, 0.0, 0.0, 2.2, 0.0, 0.0, 0.0]])
    asked = {"targets": panda.chain.tool_pose(ROOT[None], q), "base": ROOT[None], "seeds": q}
    result = panda.solve(**asked, random_restarts=0, rng_seeds=np.zeros(1, np.uint64))
    check(panda, asked, result)


def test_a_free_axis_leaves_the_turn_about_it_open(panda: NumbaIk) -> None:
    asked = reachable(panda.chain, 100, 9)
    free = panda.solve(**asked, random_restarts=50, rotation_weight=(1.0, 1.0, 0.0))
    assert free.converged.all()
    poses = panda.chain.tool_pose(asked["base"], free.joint_pos)
    z = np.array([0.0, 0.0, 1.0])
    axis, wanted = P.rotate(poses[:, 3:], np.tile(z, (100, 1))), P.rotate(asked["targets"][:, 3:], np.tile(z, (100, 1)))
    assert np.arccos(np.clip(P.dot(axis, wanted), -1, 1)).max() < 2e-4
    assert np.median(P.angle_between(poses[:, 3:], asked["targets"][:, 3:])) > 0.1
    assert free.iterations.mean() < panda.solve(**asked, random_restarts=50).iterations.mean()


def test_singular_positions_stay_finite_and_are_left() -> None:
    # A stretched planar arm cannot move along itself to first order; a pose a little nearer needs it to fold.
    links = [Link((0.3, 0.0, 0.0), axis=(0.0, 1.0, 0.0)) for _ in range(3)]
    ik = solver(*links, tool=(0.3, 0.0, 0.0))
    target = np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])
    asked = {"targets": target, "base": ROOT[None], "seeds": np.zeros((1, 3)), "rng_seeds": np.zeros(1, np.uint64)}
    result = ik.solve(**asked, random_restarts=20)
    assert result.converged.all()
    check(ik, asked, result)
    step = ik.step(target, ROOT[None], np.zeros((1, 3)), max_step=0.1)
    assert np.isfinite(step.joint_pos).all()
    assert np.abs(step.joint_pos).max() < 1e-6


def test_a_stretched_arm_is_reached_exactly_at_its_edge() -> None:
    links = [Link((0.3, 0.0, 0.0), axis=(0.0, 1.0, 0.0)) for _ in range(3)]
    ik = solver(*links, tool=(0.3, 0.0, 0.0))
    seeds = np.array([[0.4, -0.7, 0.2]])
    target = ik.chain.tool_pose(ROOT[None], np.zeros((1, 3)))
    result = ik.solve(target, ROOT[None], seeds, random_restarts=30, rng_seeds=np.zeros(1, np.uint64))
    assert result.converged.all()


def test_sliding_joints_and_off_origin_anchors_are_solved() -> None:
    slide = JointType.PRISMATIC
    ik = solver(
        Link((0.0, 0.0, 0.2), axis=(1.0, 0.0, 0.0), lower=-0.5, upper=0.5, type=slide),
        Link((0.0, 0.0, 0.1), axis=(0.0, 0.6, 0.8), lower=-0.4, upper=0.4, type=slide),
        Link((0.1, 0.0, 0.0), (0.2, 0.3, 0.0), anchor=(0.1, 0.05, 0.0)),
        Link((0.2, 0.0, 0.1), axis=(0.0, 1.0, 0.0), anchor=(-0.05, 0.0, 0.02)),
        Link((0.1, 0.0, 0.1), axis=(1.0, 0.0, 0.0), anchor=(0.0, 0.1, 0.0)),
        Link((0.1, 0.1, 0.0), axis=(0.0, 0.0, -1.0)),
        tool=(0.0, 0.1, 0.1),
    )
    asked = reachable(ik.chain, 100, 10)
    result = ik.solve(**asked, random_restarts=200)  # six joints: few solutions, some of them at the limits
    assert result.converged.all()
    check(ik, asked, result)


def test_joints_without_limits_search_around_their_seed() -> None:
    inf = float("inf")
    axes = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    ik = solver(*(Link((0.2, 0.0, 0.05), axis=a, lower=-inf, upper=inf) for a in axes), tool=(0.1, 0.0, 0.0))
    rng = np.random.default_rng(11)
    base = np.tile(ROOT, (50, 1))
    targets = ik.chain.tool_pose(base, rng.uniform(-3, 3, (50, 6)))
    seeds = 50.0 + rng.uniform(-3, 3, (50, 6))
    result = ik.solve(targets, base, seeds, random_restarts=50, rng_seeds=np.arange(50, dtype=np.uint64))
    assert result.converged.all()
    assert np.abs(result.joint_pos - 50.0).max() < 40.0


def test_no_rows_give_no_answers(panda: NumbaIk) -> None:
    none = np.empty((0, 7))
    result = panda.solve(none, none, none, random_restarts=3, rng_seeds=np.empty(0, np.uint64))
    assert result.joint_pos.shape == (0, 7)
    assert panda.step(none, none, none, max_step=0.1).joint_pos.shape == (0, 7)


def test_read_only_and_strided_questions_are_taken(panda: NumbaIk) -> None:
    asked = reachable(panda.chain, 40, 12)
    expected = panda.solve(**rows(asked, slice(None, None, 2)), random_restarts=3)
    for array in asked.values():
        array.setflags(write=False)
    assert same_bits(panda.solve(**rows(asked, slice(None, None, 2)), random_restarts=3), expected)


def test_following_a_line_keeps_the_tool_on_it(panda: NumbaIk) -> None:
    chain = panda.chain
    n, dt = 16, 0.02
    base = np.tile(ROOT, (n, 1))
    q = np.tile(chain.initial, (n, 1)) + np.random.default_rng(13).uniform(-0.1, 0.1, (n, 7))
    start = chain.tool_pose(base, q)
    goal = start.copy()
    goal[:, :3] += np.random.default_rng(14).uniform(-0.1, 0.1, (n, 3))
    ticks = int(np.ceil(P.norm(goal[:, :3] - start[:, :3]).max() / (0.1 * dt)))  # at 0.1 m/s
    for tick in range(ticks):
        target = start.copy()
        target[:, :3] += (tick + 1) / ticks * (goal - start)[:, :3]
        before = q
        q = panda.step(target, base, q, max_step=chain.velocity_limit * dt).joint_pos
        assert (np.abs(q - before) <= chain.velocity_limit * dt + 1e-12).all()
        now = chain.tool_pose(base, q)
        assert P.norm(now[:, :3] - target[:, :3]).max() < 1e-3
    for _ in range(10):
        q = panda.step(goal, base, q, max_step=chain.velocity_limit * dt).joint_pos
    last = panda.step(goal, base, q, max_step=0.1)
    assert last.position_error.max() < 1e-6
    assert last.rotation_error.max() < 1e-6


def test_the_posture_moves_the_elbow_and_not_the_tool(panda: NumbaIk) -> None:
    chain = panda.chain
    q = chain.initial[None] + np.array([[0.5, 0.1, -0.6, 0.1, 0.3, 0.0, 0.2]])
    target = chain.tool_pose(ROOT[None], q)
    before = np.abs(q - chain.initial).max()
    for _ in range(200):
        q = panda.step(target, ROOT[None], q, max_step=0.05, posture=chain.initial, posture_gain=0.1).joint_pos
    last = panda.step(target, ROOT[None], q, max_step=0.05)
    assert last.position_error[0] < 1e-3
    assert last.rotation_error[0] < 2e-3
    assert np.abs(q - chain.initial).max() < before - 0.1


def test_steps_stay_within_limits_and_the_others_make_up_for_a_joint_at_its_limit() -> None:
    # The first joint cannot turn further up; the two others can still lift the tool.
    hinge = (0.0, -1.0, 0.0)
    ik = solver(
        Link((0.0, 0.0, 0.0), axis=hinge, upper=0.0),
        Link((0.3, 0.0, 0.0), axis=hinge),
        Link((0.3, 0.0, 0.0), axis=hinge),
        tool=(0.2, 0.0, 0.0),
    )
    q = np.array([[0.0, 0.3, -0.8]])
    target = ik.chain.tool_pose(ROOT[None], q) + np.array([0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0])
    for _ in range(50):
        q = ik.step(target, ROOT[None], q, max_step=0.05, rotation_weight=(0.0, 0.0, 0.0)).joint_pos
        assert (q <= ik.chain.upper).all()
        assert (q >= ik.chain.lower).all()
    assert ik.step(target, ROOT[None], q, max_step=0.05).position_error[0] < 1e-5


def test_a_long_step_is_scaled_as_a_whole(panda: NumbaIk) -> None:
    asked = reachable(panda.chain, 30, 15)
    full = panda.step(asked["targets"], asked["base"], asked["seeds"], max_step=np.inf).joint_pos - asked["seeds"]
    short = panda.step(asked["targets"], asked["base"], asked["seeds"], max_step=0.01).joint_pos - asked["seeds"]
    assert np.abs(short).max() <= 0.01 + 1e-15
    scale = np.minimum(1.0, 0.01 / np.abs(full).max(axis=1))
    np.testing.assert_allclose(short, full * scale[:, None], atol=1e-14)


def test_a_row_of_a_step_is_the_same_bits_in_any_batch(panda: NumbaIk) -> None:
    asked = reachable(panda.chain, 33, 16)
    put = (asked["targets"], asked["base"], asked["seeds"])
    together = panda.step(*put, max_step=0.05, posture=panda.chain.initial)
    for i in range(33):
        alone = panda.step(*(array[i : i + 1] for array in put), max_step=0.05, posture=panda.chain.initial)
        assert all((a[0] == b[i]).all() for a, b in zip(alone, together, strict=True))


@pytest.mark.parametrize("option", ["position_tolerance", "rotation_tolerance", "max_iterations", "threads"])
def test_options_that_are_not_positive_are_refused(panda: NumbaIk, option: str) -> None:
    with pytest.raises(AnysimError, match=f"{option} of numba_ik: expected a positive number, got 0"):
        inverse_kinematics(panda.chain, "numba_ik", **{option: 0})
