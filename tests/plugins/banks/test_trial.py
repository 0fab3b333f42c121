"""Trials in physics: what is held and what is not, on every engine; the order and the number of envs do not matter."""

import numpy as np
import pytest

from anysim.api import compile_world
from anysim.engine.capability import Capability
from anysim.engine.factory import runnable
from anysim.errors import AssetError
from anysim.model.world import World
from anysim.testing.engines import require_engine
from anysim_banks.gripper import Gripper, gripper
from anysim_banks.making import Order, made, tried_on
from anysim_banks.method import Grasps
from anysim_banks.sampling import Candidates, sample, tool_turn
from anysim_banks.subject import subjects
from anysim_banks.trial import CREEP, HARDEST, Trial
from tests.tiers import others_in_turn

DOWN = [1.0, 0.0, 0.0, 0.0]
ENGINES = runnable(Capability.WRENCHES)


@pytest.fixture(scope="module")
def hand() -> Gripper:
    return gripper()


def box_world(**more: object) -> World:
    return compile_world({"world": {"objects": {"box": {"source": {"box": [0.04, 0.06, 0.1]}, "mass": 0.2, **more}}}})


def grasps(*positions: tuple[float, float, float], width: float = 0.06) -> Candidates:
    """From above, closing along y."""
    n = len(positions)
    pose = np.concatenate([np.array(positions), np.tile(DOWN, (n, 1))], axis=1)
    return Candidates(pose, np.full(n, width), np.full(n, "box"), np.zeros(n, dtype=int))


@pytest.mark.parametrize("engine", [e for e in ("mujoco", "pybullet", "sapien") if e in ENGINES])
def test_a_grasp_at_the_middle_holds_more_than_one_at_the_edge_and_one_beside_it_nothing(
    hand: Gripper, engine: str
) -> None:
    [box] = subjects(box_world(), "box")
    with Trial(hand, box, engine, envs=3) as trial:
        verdicts = trial.run(grasps((0.0, 0.0, 0.0), (0.0, 0.0, 0.049), (0.0, 0.0, 0.08)))
    middle, edge, beside = verdicts.margin
    assert middle >= 1.0
    assert middle >= edge
    assert beside == 0.0
    assert verdicts.missed.tolist() == [False, False, True]


def test_what_weighs_more_than_friction_holds_is_not_admitted(hand: Gripper) -> None:
    """Two pads with 20 N each and the friction 1 of rubber hold at most 40 N."""
    light, heavy = (subjects(box_world(mass=mass), "box")[0] for mass in (2.0, 6.0))
    for subject, held in ((light, True), (heavy, False)):
        with Trial(hand, subject, "mujoco", envs=1) as trial:
            margin = trial.run(grasps((0.0, 0.0, 0.0))).margin
        assert (margin[0] >= 1.0) == held
    assert HARDEST > 1.0


def test_verdicts_do_not_depend_on_order_and_number_of_envs(hand: Gripper) -> None:
    [box] = subjects(box_world(mass=0.6), "box")
    some = sample(box.pieces, box.affordance, box.frame, 12, hand.max_width, np.random.default_rng(5))
    with Trial(hand, box, "mujoco", envs=5) as trial:
        there = trial.run(some).margin
    back = np.arange(12)[::-1]
    with Trial(hand, box, "mujoco", envs=12) as trial:
        np.testing.assert_array_equal(trial.run(some.take(back)).margin[back], there)
    assert len(np.unique(there)) > 1, "the margins rank"


def test_a_handle_is_pulled_along_its_joint(hand: Gripper) -> None:
    world = compile_world({"world": {"objects": {"cabinet": {"source": "procedural:cabinet", "fixed": True}}}})
    [drawer] = subjects(world, "cabinet", "drawer_1.handle")
    [door] = subjects(world, "cabinet", "door_1.handle")
    assert drawer.pull is not None
    assert door.pull is not None
    np.testing.assert_allclose(drawer.pull, [1.0, 0.0, 0.0])
    assert abs(float(door.pull[0])) > 0.95, "a door's handle begins to move out of its front"
    bank, rate = made(Grasps(drawer, hand), "mujoco", Order(60, 8), print)
    assert rate > 0
    assert (bank.approach[:, 0] < -0.5).all(), "from the front"
    again, _ = made(Grasps(drawer, hand), "mujoco", Order(60, 8), print)
    assert again.version == bank.version
    assert 4 <= len(bank) <= 8
    np.testing.assert_array_equal(np.sort(bank.margin)[::-1], bank.margin)


def test_a_thing_too_wide_says_so(hand: Gripper) -> None:
    world = compile_world({"world": {"objects": {"crate": {"source": {"box": [0.3, 0.3, 0.3]}}}}})
    with pytest.raises(AssetError, match=r"no grasp of crate body was held: nothing there is narrower than 0\.081 m"):
        made(Grasps(subjects(world, "crate")[0], hand), "mujoco", Order(20, 4), print)


@pytest.mark.parametrize(
    ("source", "affordance", "engine"),
    others_in_turn(
        [{"box": [0.04, 0.06, 0.1]}, {"cylinder": [0.03, 0.12]}, "procedural:mug"], ["body", "body", "handle"]
    ),
)
def test_most_of_what_mujoco_keeps_is_held_on_the_other_engines(
    hand: Gripper, source: dict[str, object] | str, affordance: str, engine: str
) -> None:
    require_engine(engine)
    world = compile_world({"world": {"objects": {"thing": {"source": source}}}})
    [thing] = subjects(world, "thing", affordance)
    bank, _ = made(Grasps(thing, hand), "mujoco", Order(300, 32), print)
    bank = tried_on(bank, Grasps(thing, hand), [engine], print)
    assert bank.passed_on(engine).mean() >= 0.9


def test_a_thin_bar_far_from_the_weight_turns_in_the_fingers_slowly(hand: Gripper) -> None:
    """Across the middle of a mug's handle the easy test is passed, and the long one is not; at a box it is."""
    world = compile_world({"world": {"objects": {"mug": {"source": "procedural:mug"}}}})
    [handle], [box] = subjects(world, "mug", "handle"), subjects(box_world(), "box")
    turn = tool_turn(np.array([[0.0, 1.0, 0.0]]), np.array([[-1.0, 0.0, 0.0]]))
    pose = np.concatenate([handle.frame[None, :3], turn], axis=1)
    across = Candidates(pose, np.array([0.01]), np.array(["bar"]), np.zeros(1, dtype=int))
    with Trial(hand, handle, "mujoco", envs=1) as trial:
        assert trial.run(across, hard=False).margin[0] == 1.0
        assert not trial.lasting(across, CREEP)[0]
    with Trial(hand, box, "mujoco", envs=1) as trial:
        assert trial.lasting(grasps((0.0, 0.0, 0.0)), CREEP)[0]
