"""Forks made a second time: not replayed, but from a fresh episode into which the recorded state is written."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.model.parts import BodyKind
from anysim.record.replay import begin, rebuild
from anysim_language.check.scene import RawScene
from anysim_language.episode import Episode

FAR, UP, SECONDS = 0.019, 50.0, 1.0
"""[m] What goes further has moved or fallen; what is removed is put so high [m]; it is looked at so much later [s]."""
MIDWAY = 0.1
"""Share of a joint's range between shut and open."""


class ForkedAgain:
    """The engine of a recording in an env of its own."""

    def __init__(self, episode: Episode) -> None:
        assert episode.reader is not None
        self.episode, self.reader = episode, episode.reader
        self.env = rebuild(self.reader.manifest, base=episode.base)
        self._ends: dict[tuple[Any, ...], tuple[Array, Array]] = {}

    def close(self) -> None:
        """Free the engine."""
        self.env.close()

    def outcome(self, step: int, program: Mapping[str, Any]) -> str:
        """`falls`, `moves`, `stays` or `closes`: what becomes of the program's thing by its change."""
        key = (step, *(str(program[name]) for name in ("kind", "what", "part", "wrench", "seconds")))
        if key not in self._ends:
            self._ends[key] = self._end(step, program)
        poses, joints = self._ends[key]
        world, (name, _, part) = self.episode.world, program["thing"].partition(".")
        entity = next(thing.entity for thing in self.episode.things if thing.name == name)
        if part:
            body = f"{world.entities[entity].name}.{part}"
            j, joint = next((j, one) for j, one in enumerate(world.joints) if world.bodies[one.body].name == body)
            share = (np.array([self.episode.joint_pos[step, j], joints[j]]) - joint.lower) / (joint.upper - joint.lower)
            return "closes" if share[1] < MIDWAY < share[0] else "stays" if abs(share[1] - share[0]) < MIDWAY else ""
        before, after = RawScene(world, self.episode.body_pose[step]), RawScene(world, poses)
        drop = before.bounds(entity)[0][2] - after.bounds(entity)[0][2]
        moved = after.middle(entity, True) - before.middle(entity, True)
        if drop > FAR:
            return "falls"
        return "stays" if np.linalg.norm(moved) < FAR else "moves"

    def _end(self, step: int, program: Mapping[str, Any]) -> tuple[Array, Array]:
        """Poses (B, 7) and joints (J,) after a change to the recorded state of a step."""
        engine, world = self.env.engine, self.env.engine.world
        begin(self.env, self.reader.manifest)
        recorded = {name: self.reader.states_from_reset(name)[step] for name in self.reader.manifest.layout.state}
        engine.set_joint_state(recorded["joint_pos"][None], recorded["joint_vel"][None])
        free = [k for k, body in enumerate(world.bodies) if body.kind is BodyKind.FREE]
        if free:
            engine.set_body_state(recorded["body_pose"][None, free], recorded["body_twist"][None, free], bodies=free)
        drives = {name.removeprefix("control_"): rows[None] for name, rows in recorded.items() if "control_" in name}
        engine.set_control(**drives | {"velocity": np.zeros((1, len(world.actuators)))})
        self._do(program)
        steps = round(SECONDS / world.physics.dt)
        pushed = round(program["seconds"] / world.physics.dt)
        if pushed:
            engine.step(pushed)
        if steps > pushed:
            engine.step(steps - pushed)
        state = engine.get_state()
        return state.body_pose[0].copy(), state.joint_pos[0].copy()

    def _do(self, program: Mapping[str, Any]) -> None:
        """The program's change."""
        engine, world = self.env.engine, self.env.engine.world
        entity = next(thing.entity for thing in self.episode.things if thing.name == program["what"])
        first = world.entities[entity].body_start
        if program["kind"] == "open":
            hand = next(robot for robot in world.robots if robot.name == program["what"]).channels["eef"]
            for actuator, target in zip(hand.actuators, hand.opened or (), strict=False):
                engine.set_control(position=[[target]], actuators=[actuator])
        elif program["kind"] == "remove":
            pose = np.array(self.env.engine.get_state().body_pose[0, first])
            pose[2] += UP
            engine.set_body_state(pose[None, None], bodies=[first])
        else:
            names = [body.name for body in world.bodies]
            body = names.index(program["part"]) if program["part"] else first
            engine.apply_wrench(np.array(program["wrench"])[None, None], [body])
