"""Wipe: go over a rectangle of a surface in rows, pressed against it with a bounded lead."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.phases import GO_ON, STAY, Phase, PhasedSkill, Rung
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, RobotView
from anysim_skills.arm import LEAD, SLIPPED, Arm
from anysim_skills.choice import Choice, turns_against
from anysim_skills.grasping.grasp import Metres, Speed
from anysim_skills.moving.raster import Coverage, Raster
from anysim_skills.recovery.homing import Homing, still_held

TURNS = 8
"""Orientations of the hand about the normal that are tried."""
LAG = 0.006
"""[m] the path waits for a tip that is further behind it."""
GAIN = 0.15
"""Share of the tip's distance from the path by which its command is moved further in a control step."""
FURTHEST = 0.04
"""[m] along the surface, by which friction is overcome at most."""
CONTACT = 0.01
"""[m] a tip that is further from the height at which it touched is not in contact: what is held turns in the hand."""
FALLING = 0.01
"""[m/s] nor is one that sinks faster: nothing holds it up."""
DEEPEST = 0.03
"""[m] below the patch, where the tip looks for the surface."""
TOUCH_UP_STEPS = 200
STUCK_STEPS = 100
"""Control steps that the path waits before the tip counts as stuck."""

Size = Annotated[
    tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]], Field(description="[m] along x and y")
]


class Wipe(PhasedSkill):
    """Wipe a rectangle of `size` about `patch`, whose z points out of the surface, with `tip`.

    `tip` is a frame of the hand, or of what it holds, such as `panda.tool` or `sponge`; the fingers stay closed. What
    is covered is measured from where the tip was while it was in contact. Fingers of rubber stick to what they press
    on, and are `jammed`; let them hold something that slides.
    """

    first = 1

    def __init__(
        self,
        env: TaskEnv,
        *,
        robot: RobotView,
        patch: Frame,
        tip: Frame,
        size: Size = (0.2, 0.15),
        tool: str = "tool",
        solver: str = "numba_ik",
        width: Annotated[float, Field(gt=0, description="[m] of what wipes")] = 0.02,
        press: Annotated[float, Field(gt=0, description="[m] the command is so far below the tip: the force")] = 0.002,
        share: Annotated[float, Field(gt=0, le=1, description="of the rectangle that is enough")] = 0.9,
        clear: Metres = 0.06,
        speed: Speed = 0.3,
        wipe_speed: Speed = 0.12,
        steps: Annotated[int, Field(ge=1, description="control steps that a move may take")] = 200,
    ) -> None:
        self.arm = Arm.of(env, robot, tool=tool, solver=solver)
        self._patch, self._tip, self._size, self._press, self._share = patch, tip, size, press, share
        self._held_tip = tip.name.partition(".")[0] != robot.name
        self._clear, self._speed, self._wipe_speed, self._late = clear, speed, wipe_speed, steps
        self._dt = env.engine.world.physics.control_dt
        n = env.num_envs
        self._raster, self._coverage = Raster(size, width), Coverage(n, size, width)
        self._choice, self._turn = Choice(n, TURNS), np.zeros((n, 4))
        self._along, self._touched = np.zeros((2, n))
        """(N,) [m] how far along the raster it is, and at what height the tip touched."""
        self._grip = np.zeros((n, 3))
        """(N, 3) [m] the tip in the tool's frame when it touched."""
        self._against = np.zeros((n, 2))
        """(N, 2) [m] how far the tip is told to go beyond the path, so that friction does not hold it back."""
        self._waited = np.zeros(n, dtype=np.int64)
        super().__init__(env, [self.arm])

    def make_phases(self) -> Sequence[Phase]:
        rows = int(3 * self._raster.length / (self._wipe_speed * self._dt)) + self._late
        return (
            Phase("rise", self._withdraw, self._withdrawing, self._late),
            Phase("choose", self._choose, self._chosen, 1),
            Phase("approach", None, self._approach, self._late),
            Phase("touch", None, self._touching, self._late),
            Phase("wipe", self._touch, self._wiping, rows),
            Phase("touch up", None, self._touching_up, TOUCH_UP_STEPS + 1),
            Phase("retreat", self._withdraw, self._withdrawing, self._late),
        )

    def start(self, env_ids: Array) -> None:
        super().start(env_ids)
        self._coverage.clear(env_ids)

    def forget(self, env_ids: Array) -> None:
        self._choice.again(env_ids)

    def make_recovery(self) -> Sequence[Phase]:
        return Homing(self, self.arm, opens=False).phases()

    def recovers(self, env: int, failure: Outcome) -> bool:
        return still_held(self.arm, env, failure)

    def retry(self, rung: Rung, env: int) -> int | None:
        """Once more over it with what is covered; the next turn of the hand where the way was at fault."""
        return self._choice.retry(rung, env, same=(Rung.BACK_OFF,))

    def covered(self, ids: Array) -> Array:
        """(n,) share of the rectangle that the tip has been over while in contact."""
        return self._coverage.share(ids)

    def wanted(self, ids: Array, at: Array, grasps: Array) -> Array:
        """Tool poses (n, g, TURNS, 5, 7) at the corners, in grasps (n, g, 7) of what the tip is a frame of."""
        n, g = grasps.shape[:2]
        held = np.broadcast_to(self._grips(at)[:, None], (n, g, 3))
        if self._held_tip:
            held = P.rotate_inverse(grasps[..., 3:], self._tip.position[at][:, None] - grasps[..., :3])
        turns = turns_against(self._patch.quaternion[at], TURNS)
        found = self._corners(at, np.tile(turns, (1, g, 1)), np.repeat(held, TURNS, axis=1))
        return found.reshape(n, g, TURNS, *found.shape[2:])

    # ------------------------------------------------------------------ where the tip is, and is to be

    def _grips(self, at: Array) -> Array:
        """(n, 3) [m] the tip in the tool's frame."""
        tool = self.arm.tool.pose[at]
        return P.rotate_inverse(tool[:, 3:], self._tip.position[at] - tool[:, :3])

    def _at(self, at: Array, turns: Array, points: Array, grip: Array) -> Array:
        """Tool poses (n, g, 7) of turns (n, g, 4) with the tip at points (n, g, 3) of the patch's frame.

        In the tool's frame it is at (n, g, 3), or at (n, 1, 3).
        """
        patch = self._patch.pose[at][:, None]
        quaternion = np.broadcast_to(patch[..., 3:], (*points.shape[:-1], 4))
        place = patch[..., :3] + P.rotate(quaternion, points)
        return np.concatenate([place - P.rotate(turns, np.broadcast_to(grip, place.shape)), turns], axis=-1)

    def _move(self, ids: Array, at: Array, point: Array, height: Array, speed: float, lead: float = LEAD) -> None:
        """Towards points (n, 2) of the patch at heights (n,)."""
        target = np.concatenate([point, height[:, None]], axis=1)[:, None]
        pose = self._at(at, self._turn[ids, None], target, self._grips(at)[:, None])[:, 0]
        self.arm.go(ids, pose, speed, lead)

    def _seen(self, at: Array) -> Array:
        """(n, 3) [m] the tip in the patch's frame."""
        patch = self._patch.pose[at]
        return P.rotate_inverse(patch[:, 3:], self._tip.position[at] - patch[:, :3])

    # ------------------------------------------------------------------ phases

    def _withdraw(self, ids: Array, at: Array) -> None:
        self.arm.closed[ids] = True
        self.arm.command[ids] = self.arm.tool.pose[at]  # the press ends
        away = P.compose(self.arm.tool.pose[at], np.array([[0.0, 0.0, -self._clear, 0.0, 0.0, 0.0, 1.0]]))
        self.arm.go(ids, away, self._speed)

    def _withdrawing(self, ids: Array, at: Array) -> Array:
        return np.where(self.arm.arrived(ids, at, 0.01, 0.1) | (self.steps[ids] >= self._late - 1), GO_ON, STAY)

    def _choose(self, ids: Array, at: Array) -> None:
        self.arm.closed[ids] = True
        turns = turns_against(self._patch.quaternion[at], TURNS)
        targets = self._corners(at, turns, self._grips(at)[:, None])
        self._turn[ids] = turns[np.arange(len(ids)), self._choice.least_motion(self.arm, ids, targets)]

    def _corners(self, at: Array, turns: Array, grip: Array) -> Array:
        """Tool poses (n, g, 5, 7) of turns (n, g, 4) over a corner of the rectangle, and at each."""
        x, y = 0.5 * self._size[0], 0.5 * self._size[1]
        corners = [(-x, -y, self._clear), *((sx * x, sy * y, 0.0) for sx in (-1, 1) for sy in (-1, 1))]
        shape = (*turns.shape[:2], 3)
        return np.stack([self._at(at, turns, np.broadcast_to(np.array(c), shape), grip) for c in corners], axis=2)

    def _chosen(self, ids: Array, at: Array) -> Array:
        del at
        return np.where(self._choice.none_left(ids), _NO_IK, GO_ON)

    def _approach(self, ids: Array, at: Array) -> Array:
        begin = self._raster.point(np.zeros(len(ids)))
        self._move(ids, at, begin, np.full(len(ids), self._clear), self._speed)
        return np.where(self.arm.arrived(ids, at, 0.008, 0.06), GO_ON, STAY)

    def _touching(self, ids: Array, at: Array) -> Array:
        """Down until the surface holds the tip up."""
        height = self._seen(at)[:, 2]
        begin = self._raster.point(np.zeros(len(ids)))
        self._move(ids, at, begin, height - 2 * self._press, 0.5 * self._wipe_speed, self._press)
        touching = (self.steps[ids] >= 10) & self.arm.touching(ids, at)
        return np.where(height < -DEEPEST, _MISSED, np.where(touching, GO_ON, STAY))

    def _touch(self, ids: Array, at: Array) -> None:
        self._touched[ids], self._grip[ids] = self._seen(at)[:, 2], self._grips(at)
        self._along[ids], self._against[ids], self._waited[ids] = 0.0, 0.0, 0

    def _pressed_to(self, ids: Array, at: Array, point: Array) -> Array:
        """Towards points (n, 2), pressed; (n,) [m] how far the tip is from them."""
        seen = self._seen(at)
        behind = point - seen[:, :2]
        against = self._against[ids] + GAIN * behind
        against *= np.minimum(1.0, FURTHEST / np.maximum(P.norm(against), FURTHEST))[:, None]
        self._against[ids] = against
        self._move(ids, at, point + against, seen[:, 2] - self._press, self._speed, LEAD + FURTHEST)
        sinking = -P.rotate_inverse(self._patch.quaternion[at], self._tip.twist[at, :3])[:, 2]
        contact = (np.abs(seen[:, 2] - self._touched[ids]) < CONTACT) & (sinking < FALLING)
        self._coverage.add(ids[contact], seen[contact, :2])
        return P.norm(behind)

    def _held(self, ids: Array, at: Array, said: Array) -> Array:
        """(n,) what is said, or that the tip has slipped in the hand."""
        return np.where(P.norm(self._grips(at) - self._grip[ids]) > SLIPPED, _UNSTABLE, said)

    def _wiping(self, ids: Array, at: Array) -> Array:
        behind = self._pressed_to(ids, at, self._raster.point(self._along[ids]))
        on = behind < LAG
        self._along[ids] += np.where(on, self._wipe_speed * self._dt, 0.0)
        self._waited[ids] = np.where(on, 0, self._waited[ids] + 1)
        over = on & (self._along[ids] >= self._raster.length)
        said = np.where(self._waited[ids] > STUCK_STEPS, _JAMMED, STAY)
        return self._held(ids, at, np.where(over, GO_ON, said))

    def _touching_up(self, ids: Array, at: Array) -> Array:
        """To the nearest cell that was left out, until enough is covered."""
        self._pressed_to(ids, at, self._coverage.nearest_left(ids, self._seen(at)[:, :2]))
        over = (self.covered(ids) >= self._share) | (self.steps[ids] >= TOUCH_UP_STEPS)
        return self._held(ids, at, np.where(over, GO_ON, STAY))

    def succeeded(self, env_ids: Array, at: Array) -> Array:
        del at
        return np.where(self.covered(env_ids) >= self._share, GO_ON, _MISSED)


_NO_IK, _UNSTABLE = OUTCOMES.index(Outcome.NO_IK), OUTCOMES.index(Outcome.UNSTABLE_GRASP)
_MISSED, _JAMMED = OUTCOMES.index(Outcome.MISSED_CONTACT), OUTCOMES.index(Outcome.JAMMED)
