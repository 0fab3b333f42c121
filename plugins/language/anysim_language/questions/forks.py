"""Forks of recorded episodes: what becomes of everything if something else were done at a moment, by the engine.

An episode is replayed to each moment that is asked about. From a snapshot of it the engine goes on once for each
change, while the robots hold still; then it is put back and replays on.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.control import MODES
from anysim.errors import RecordError
from anysim.math import pose as P
from anysim.model.parts import BodyKind, ControlMode, JointType
from anysim.record.replay import begin, rebuild
from anysim_language.changes import AJAR
from anysim_language.episode import Episode
from anysim_language.joints import movable_parts
from anysim_language.things import Thing

SAME = 1e-6
"""[m] A replay is of the recording where no body is further from its recorded place."""
LOOKED_AT = (1.0, 1.5)
"""[s] When it is looked at what has become of things; nothing is asked of which the two differ."""
AWAY = 50.0
"""[m] What is removed is put so high up that it does not come down again."""
PUSHES = ((0.1, 0.5), (2.0, 0.2))
"""Forces in weights of a thing, and for how long [s] they push it."""
HAND = "eef"
SHUTTING = {JointType.PRISMATIC: 10.0, JointType.REVOLUTE: 2.0}
"""[N, N m] What pushes a part shut, for the time of the first look."""


class Change(NamedTuple):
    """What is done at a moment: `open` a robot's gripper, `remove` or `push` a thing, push a part `shut`; or nothing.

    Attributes:
        kind: empty for nothing.
        what: the robot or the thing, by its logical name.
        part: the body of what is pushed shut.
        wrench: (6,) [N, N m] on it, for `seconds`.
    """

    kind: str = ""
    what: str = ""
    part: str = ""
    wrench: tuple[float, ...] = ()
    seconds: float = 0.0


class Fork(NamedTuple):
    """A change, and where everything is at the times of LOOKED_AT: bodies (2, B, 7) and joints (2, J)."""

    change: Change
    body_pose: Array
    joint_pos: Array


def forked(episode: Episode, steps: Sequence[int]) -> dict[int, tuple[Fork, ...]]:
    """The forks at some control steps of a recorded episode, the one without a change first.

    Raises:
        RecordError: the recording does not replay as it was.
        CapabilityError, PluginError: its engine is not here, or cannot be put back to a moment.
    """
    assert episode.reader is not None
    manifest, actions = episode.reader.manifest, episode.reader.actions
    found: dict[int, tuple[Fork, ...]] = {}
    with rebuild(manifest, base=episode.base) as env:
        begin(env, manifest)
        for step in range(max(steps, default=-1) + 1):
            if step:
                env.step(actions[step - 1][None])
            if step in steps:
                _refuse_other(episode, env.engine, step)
                found[step] = tuple(_forks(episode, env.engine, step))
    return found


def _refuse_other(episode: Episode, engine: SimEngine, step: int) -> None:
    here, there = engine.get_state().body_pose[0, :, :3], episode.body_pose[step, :, :3]
    away = np.abs(here - there).max() if here.shape == there.shape else np.inf
    if not away <= SAME:
        assert episode.reader is not None
        raise RecordError(
            f"{episode.reader.directory} does not replay as it was recorded: at step {step} something is {away:.3g} "
            f"m from where it was; use the versions that its manifest names"
        )


def _forks(episode: Episode, engine: SimEngine, step: int) -> Iterator[Fork]:
    """All at the engine's moment; the engine is there again afterwards."""
    if (engine.control.mode != MODES.index(ControlMode.EFFORT)).all():  # efforts alone do not hold a robot still
        snapshot = engine.snapshot([0])
        for change in _changes(episode, engine, step):
            yield _fork(episode, engine, change)
            engine.restore(snapshot, [0])


def _fork(episode: Episode, engine: SimEngine, change: Change) -> Fork:
    """What it comes to from here with a change."""
    world, dt = engine.world, engine.world.physics.dt
    thing = episode.first.by_name.get(change.what)
    root = world.entities[thing.entity].root if thing is not None else -1
    engine.set_control(velocity=np.zeros_like(engine.control.velocity))
    spent = 0
    if change.kind == "open":
        hand = next(robot for robot in world.robots if robot.name == change.what).channels[HAND]
        assert hand.opened is not None
        engine.set_control(position=[hand.opened[: len(hand.actuators)]], actuators=hand.actuators)
    elif change.kind == "remove":
        pose = engine.get_state().body_pose[:, [root]].copy()
        pose[..., 2] += AWAY
        engine.set_body_state(pose, bodies=[root])
    elif change.kind:
        body = next((k for k, one in enumerate(world.bodies) if one.name == change.part), root)
        engine.apply_wrench([[change.wrench]], [body])
        spent = round(change.seconds / dt)
        engine.step(spent)
    poses: list[Array] = []
    joints: list[Array] = []
    for time in LOOKED_AT:
        if round(time / dt) > spent:
            engine.step(round(time / dt) - spent)
            spent = round(time / dt)
        state = engine.get_state()
        poses.append(state.body_pose[0].copy())
        joints.append(state.joint_pos[0].copy())
    return Fork(change, np.array(poses), np.array(joints))


def _changes(episode: Episode, engine: SimEngine, step: int) -> Iterator[Change]:
    """What can be done at a moment, in the World's order."""
    world = episode.world
    yield Change()
    for robot in world.robots:
        hand = robot.channels.get(HAND)
        if hand is not None and hand.opened is not None:
            yield Change("open", robot.name)
    masses, weight = engine.get_parameters("body.mass", [0])[0], -world.physics.gravity[2]
    fx, fy = (x / 1000.0 for x in episode.viewer.forward)
    for thing in episode.first.objects:
        if thing.count > 1:
            continue
        entity = world.entities[thing.entity]
        yield Change("remove", thing.name)
        if world.bodies[entity.root].kind is BodyKind.FREE:
            for share, seconds in PUSHES:
                force = float(f"{share * masses[entity.root] * weight:.1g}")
                wrench = (-fy * force, fx * force, 0.0, 0.0, 0.0, 0.0)
                yield Change("push", thing.name, "", wrench, seconds)
        yield from _shutting(episode, thing, step)


def _shutting(episode: Episode, thing: Thing, step: int) -> Iterator[Change]:
    """Parts of an object that stand open, pushed along or about their joints' axes."""
    world = episode.world
    for part in movable_parts(world, thing.entity):
        joint = world.joints[part.joint]
        ajar = episode.joint_pos[step, part.joint] >= part.lower + AJAR * (part.upper - part.lower)
        if part.done == "opened" and ajar and joint.type in SHUTTING:
            pose = episode.body_pose[step, joint.body]
            x, y, z = (-SHUTTING[joint.type] * P.rotate(pose[3:], np.array(joint.axis))).tolist()
            wrench = (x, y, z, 0.0, 0.0, 0.0) if joint.type is JointType.PRISMATIC else (0.0, 0.0, 0.0, x, y, z)
            yield Change("shut", thing.name, part.name, wrench, LOOKED_AT[0])
