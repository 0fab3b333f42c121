"""What stepping through SimEngine costs on MuJoCo, against the same loop over `mujoco.batch.Batch`.

A nine-joint arm with a gripper and five boxes, built by hand, so that nothing but the engine is needed:

    python benchmarks/step_mujoco.py            # N = 1, 16, 64, 256
    python benchmarks/step_mujoco.py 1 1024     # other numbers of envs

Both loops take turns, one control step each, in one process; of each the fastest tenth counts, which other load on the
machine disturbs least. `anysim benchmark` measures the same with the catalogue's Panda.
"""

import sys
import time
from collections.abc import Callable, Sequence

import numpy as np

from anysim.engine.factory import create_simulation
from anysim.world.model import (
    Actuator,
    Body,
    BodyKind,
    Box,
    Capsule,
    ControlMode,
    Entity,
    EntityKind,
    Geom,
    Inertial,
    Joint,
    JointType,
    Mimic,
    Plane,
    World,
)

BOXES = 5
SUBSTEPS = 10
TURNS = 2000  # of one env; fewer of many


def arm_and_boxes() -> World:
    """An arm of seven links and two coupled fingers, of a Panda's size, and boxes on the ground."""
    bodies = [Body("arm.base", BodyKind.STATIC, inertial=Inertial(3.0, (0.0, 0.0, 0.1), (0.02, 0.02, 0.01, 0, 0, 0)))]
    geoms = [Geom("ground", -1, Plane()), Geom("arm.base", 0, Capsule(0.07, 0.05), position=(0.0, 0.0, 0.1))]
    joints, actuators = [], []
    axes = ((0, 0, 1), (0, 1, 0), (0, 0, 1), (0, -1, 0), (0, 0, 1), (0, -1, 0), (0, 0, 1))
    lengths = (0.333, 0.15, 0.166, 0.15, 0.234, 0.1, 0.1)
    initial = (0.0, 0.3, 0.0, -1.2, 0.0, 1.2, 0.7)
    for i, (axis, length) in enumerate(zip(axes, lengths, strict=True)):
        inertial = Inertial(2.5 - 0.3 * i, (0.0, 0.0, length / 2), (0.02, 0.02, 0.005, 0.0, 0.0, 0.0))
        bodies.append(
            Body(f"arm.link{i}", BodyKind.LINK, i, (0.0, 0.0, (0.0, *lengths)[i]), (0, 0, 0, 1), inertial, True)
        )
        joints.append(
            Joint(
                f"arm.joint{i}",
                i + 1,
                JointType.REVOLUTE,
                axis,
                lower=-2.8,
                upper=2.8,
                armature=0.1,
                initial=initial[i],
            )
        )
        geoms.append(Geom(f"arm.link{i}", i + 1, Capsule(0.05, length / 4), position=(0.0, 0.0, length / 2)))
        actuators.append(Actuator(f"arm.joint{i}", i, ControlMode.POSITION, 1000.0, 100.0, 87.0))
    for side, y in (("left", 1.0), ("right", -1.0)):
        inertial = Inertial(0.015, (0.0, 0.0, 0.03), (1e-5, 1e-5, 1e-6, 0.0, 0.0, 0.0))
        bodies.append(Body(f"arm.{side}", BodyKind.LINK, 7, (0.0, 0.0, 0.1), (0, 0, 0, 1), inertial, True))
        mimic = Mimic(7) if side == "right" else None
        joints.append(
            Joint(
                f"arm.{side}",
                len(bodies) - 1,
                JointType.PRISMATIC,
                (0.0, y, 0.0),
                lower=0.0,
                upper=0.04,
                armature=0.1,
                initial=0.02,
                mimic=mimic,
            )
        )
        geoms.append(Geom(f"arm.{side}", len(bodies) - 1, Box((0.01, 0.005, 0.02)), position=(0.0, 0.01 * y, 0.04)))
    actuators.append(Actuator("arm.grip", 7, ControlMode.POSITION, 1000.0, 20.0, 40.0))
    entities = [Entity("arm", EntityKind.ROBOT, 0, len(bodies), 0, len(joints))]
    cube = Inertial(0.108, inertia=(6.5e-5, 6.5e-5, 6.5e-5, 0.0, 0.0, 0.0))
    for i in range(BOXES):
        entities.append(Entity(f"box{i}", EntityKind.OBJECT, len(bodies), len(bodies) + 1, len(joints), len(joints)))
        geoms.append(Geom(f"box{i}", len(bodies), Box((0.03, 0.03, 0.03))))
        bodies.append(Body(f"box{i}", BodyKind.FREE, position=(0.55, -0.3 + 0.15 * i, 0.03), inertial=cube))
    return World(
        "arm_and_boxes",
        bodies=tuple(bodies),
        joints=tuple(joints),
        geoms=tuple(geoms),
        actuators=tuple(actuators),
        entities=tuple(entities),
    )


def measure(world: World, num_envs: int) -> tuple[float, float, float]:
    """Steps per second of the raw loop [wall], and the engine's share of it by wall and by processor time."""
    with create_simulation("mujoco") as engine:
        engine.create_world(world, num_envs)
        targets = engine.control.position
        engine.step(100)

        def ours() -> None:
            engine.set_control(position=targets)
            engine.step(SUBSTEPS)
            state = engine.get_state()
            _ = state.joint_pos, state.joint_vel, state.body_pose, state.body_twist

        raw = engine.raw_loop()
        assert raw is not None  # MuJoCo has one
        turns = max(40, TURNS // num_envs)
        wall, cpu = _take_turns(turns, ours, lambda: raw(SUBSTEPS))
    return SUBSTEPS * num_envs / wall[1], wall[1] / wall[0], cpu[1] / cpu[0]


def _take_turns(turns: int, *loops: Callable[[], None]) -> tuple[list[float], list[float]]:
    """The wall and the processor time [s] of one call of each loop: the 10th percentile over so many turns."""
    spent = np.empty((turns, len(loops), 2))
    for turn in range(turns):
        for index, loop in enumerate(loops):
            wall, cpu = time.perf_counter(), time.process_time()
            loop()
            spent[turn, index] = time.perf_counter() - wall, time.process_time() - cpu
    tenth = np.percentile(spent, 10, axis=0)
    return tenth[:, 0].tolist(), tenth[:, 1].tolist()


def main(sizes: Sequence[int]) -> None:
    """Print one row per number of envs."""
    world = arm_and_boxes()
    rows = [(n, *measure(world, n)) for n in sizes]
    lines = [f"{'envs':>6} {'raw steps/s':>12} {'wall ratio':>11} {'cpu ratio':>10}"]
    lines += [f"{n:6d} {rate:12.0f} {wall:11.3f} {cpu:10.3f}" for n, rate, wall, cpu in rows]
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or (1, 16, 64, 256))
