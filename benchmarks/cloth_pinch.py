"""Cloth in the hand of a Panda: lifted from the ground, shaken and held, by a pinch of some forces and by sticky pads.

    python benchmarks/cloth_pinch.py [--engines mujoco] [--forces 20,30,40] [--seeds 10] [--no-sticky]

A towel of 0.3 m and 30 g, 30 % more or less, up to 1 cm aside, is grasped in its middle by `cloth_grasp`, lifted by
0.25 m, shaken 0.1 m to each side twice and held for a second. Each row: how many still hold it, their slip, momentum
that was lost as a share of what was given, processor time of an episode. Envs of one call are the seeds.
"""

import argparse
import time
from typing import Any, NamedTuple

import numpy as np

import anysim
from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim_garments.grasp import ClothGrasp
from anysim_skills.arm import Arm
from anysim_soft.garment import Garment

TOWEL: dict[str, Any] = {"kind": "garment", "towel": [0.3, 0.3], "spacing": 0.03, "damping": 0.05, "drag": 1.5}
TOWEL |= {"position": {"range": [[0.49, -0.01, 0.004], [0.51, 0.01, 0.004]]}, "friction": 0.4}
TOWEL |= {"areal_density": {"range": [0.233, 0.433]}}
PAD = {"tool": "panda.tool", "joint": "panda.panda_finger_joint1", "closed": 0.008}
ARM = {"controller": "joint_delta_position", "params": {"scale": 0.06}}
PANDA = {"robot": "franka_panda", "actions": {"arm": ARM, "eef": "gripper_binary"}}
LIFT = 0.25
"""[m] above where it was grasped."""
WAY = ((0.0, 80), (0.1, 25), (-0.1, 40), (0.1, 40), (-0.1, 40), (0.0, 25), (0.0, 50))
"""[m] aside, and control steps of 20 ms."""
OK = OUTCOMES.index(Outcome.OK)


class Held(NamedTuple):
    """What became of the cloth: held (N,), slip (N,) [m], share of momentum that was lost, [s] an episode."""

    held: Array
    slip: Array
    lost: float
    seconds: float


def run_of(engine: str, **pad: Any) -> dict[str, Any]:
    """The world with a pad."""
    return {
        "engine": engine,
        "physics": {"dt": 0.004, "control_dt": 0.02},
        "world": {
            "terrain": {"kind": "plane", "friction": 0.4},
            "robots": {"panda": PANDA},
            "families": {"towel": {**TOWEL, "substeps": 2, "pads": {"hand": {**PAD, **pad}}}},
        },
        "task": {"observations": {"policy": ["last_action"]}, "horizon": 2000},
    }


def shaken(engine: str, seeds: int, **pad: Any) -> Held:
    """Grasp, lift, shake and hold in as many envs as there are seeds."""
    begun = time.process_time()
    with anysim.make(run_of(engine, **pad), num_envs=seeds) as env:
        env.reset(seed=0)
        assert env.families is not None
        towel, ids = env.families.family("towel"), np.arange(seeds)
        assert isinstance(towel, Garment)
        grasp = ClothGrasp(env, robot=env.scene.robot("panda"), cloth=env.scene.category("towel"), at=(0.0, 0.0))
        grasp.begin(ids)
        arm = Arm.of(env, env.scene.robot("panda"))
        for _ in range(300):
            active = np.flatnonzero(grasp.outcome == OUTCOMES.index(Outcome.RUNNING))
            if not len(active):
                break
            action = np.zeros((seeds, env.action_dim))
            grasp.act(active, action)
            env.scene.look(done := np.setdiff1d(ids, active))
            arm.act(done, action)
            env.scene.look(None)
            env.step(action)
        first = arm.command.copy()
        for aside, steps in WAY:
            target = first + np.array([0.0, aside, LIFT, 0.0, 0.0, 0.0, 0.0])
            for _ in range(steps):
                env.scene.look(None)
                arm.go(ids, target, 0.3)
                action = np.zeros((seeds, env.action_dim))
                arm.act(ids, action)
                env.step(action)
        held = np.logical_or.reduce(env.families.state("towel").fields["held"], axis=1) & (grasp.outcome == OK)
        found = towel.balance(ids)
        lost = np.abs((found.now - found.begun - found.received + found.given)[:, :3]).max(axis=1)
        share = float((lost / np.abs(found.given).max(axis=1)).max())
        slip = towel.pads.slip[:, 0].copy() if towel.pads.pinch else np.zeros(seeds)
    return Held(held, slip, share, (time.process_time() - begun) / seeds)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engines", default="mujoco")
    parser.add_argument("--forces", default="20,30,40", help="[N] of pinches")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--no-sticky", action="store_true")
    arguments = parser.parse_args()
    pads: dict[str, dict[str, Any]] = {} if arguments.no_sticky else {"sticky": {}}
    forces = [float(force) for force in arguments.forces.split(",") if force]
    pads |= {f"pinch {force:g} N": {"grip": "pinch", "force": force} for force in forces}
    print("engine    hand           held      slip mm: median  most    lost     CPU s")
    for engine in arguments.engines.split(","):
        for called, pad in pads.items():
            found = shaken(engine, arguments.seeds, **pad)
            slip = 1e3 * found.slip[found.held] if found.held.any() else np.full(1, np.nan)
            print(
                f"{engine:9s} {called:12s} {found.held.sum():3d} of {arguments.seeds:<3d}        {np.median(slip):9.2f}"
                f" {slip.max():6.2f}  {found.lost:7.0e}   {found.seconds:5.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
