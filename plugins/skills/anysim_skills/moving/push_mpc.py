"""Strokes of a push by model predictive control: the cross-entropy method over motions of the tool.

A plan is a horizontal velocity of the tool for each of a few stretches of time. Samples of plans are tried out in
rollouts from the live state; the best ones make the mean and the spread of the next round. The first stretches of the
best sample of the last round are carried out, then it is planned again from there.
"""

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim.task.scene import Frame, ObjectView
from anysim_skills.arm import Arm
from anysim_skills.rollouts import Rollouts

STRETCH, STRETCHES = 5, 4
"""Control steps of a stretch, and stretches of a plan."""
CARRIED_OUT = 2
"""Stretches that are carried out before it is planned again."""
ROUNDS, ELITES = 2, 4
SPREAD = 0.05
"""[m/s] of the first round."""
BEHIND = 0.3
"""What a metre of the tool away from behind the object costs, in metres of the object from its goal."""


class StrokePlanner:
    """Plans of the tool's motion that push an object to a goal, one env at a time.

    Attributes:
        velocity: (N, 2) [m/s] of the tool now, world axes.
    """

    def __init__(
        self, env: TaskEnv, arm: Arm, channel: str, object: ObjectView, goal: Frame, speed: float, samples: int
    ) -> None:
        self.env, self.arm, self._object, self._goal, self._speed = env, arm, object, goal, speed
        self._rollouts = Rollouts(env, samples)
        self._drives = env.actions.slice_of(arm.robot.name, channel).controller.channel.actuators
        self._roots = [entity.root for entity in object.entities]
        self._dt = env.engine.world.physics.control_dt
        n = env.num_envs
        self._plan = np.zeros((n, STRETCHES, 2))
        self._counts = np.zeros((2, n), dtype=np.int64)
        """Control steps since the last plan, and plans since the start of the stroke."""
        self.velocity = np.zeros((n, 2))

    def begin(self, ids: Array, way: Array) -> None:
        """A stroke begins in these envs, along horizontal directions (n, 2)."""
        self._plan[ids] = (self._speed * way)[:, None]
        self._counts[:, ids] = 0

    def step(self, ids: Array, at: Array, turn: Array, radius: Array) -> None:
        """Plan where it is due, and set `velocity`; `turn` (n, 4) is the tool's orientation, `radius` (n,) [m]."""
        since = self._counts[0, ids]
        for row in np.flatnonzero(since % (CARRIED_OUT * STRETCH) == 0).tolist():
            self._replan(int(ids[row]), int(at[row]), turn[row], float(radius[row]))
        stretch = self._counts[0, ids] % (CARRIED_OUT * STRETCH) // STRETCH
        self.velocity[ids] = self._plan[ids, stretch]
        self._counts[0, ids] += 1

    def _replan(self, env_id: int, row: int, turn: Array, radius: float) -> None:
        number = self._counts[1, env_id]
        rng = np.random.default_rng((int(self.env.streams.episode_seed[env_id]), int(number)))
        mean = self._plan[env_id].copy()
        if number:
            mean = np.concatenate([mean[CARRIED_OUT:], np.repeat(mean[-1:], CARRIED_OUT, axis=0)])
        goal = self._goal.position[row, :2]
        to_goal = goal - self._object.root.position[row, :2]
        straight = self._speed * to_goal / max(float(P.norm(to_goal)), 1e-6)
        spread = np.full_like(mean, SPREAD)
        count = self._rollouts.samples
        for _ in range(ROUNDS):
            plans = mean + spread * rng.standard_normal((count, *mean.shape))
            plans[0], plans[1] = mean, straight
            plans = self._slowed(plans)
            costs = self._costs(plans, env_id, goal, turn, radius)
            best = plans[np.argsort(costs, kind="stable")[:ELITES]]
            mean, spread = best.mean(axis=0), best.std(axis=0) + 0.1 * SPREAD
        self._plan[env_id] = best[0]
        self._counts[1, env_id] += 1

    def _slowed(self, plans: Array) -> Array:
        size = P.norm(plans)[..., None]
        return plans * np.minimum(1.0, 1.5 * self._speed / np.maximum(size, 1e-9))

    def _costs(self, plans: Array, env_id: int, goal: Array, turn: Array, radius: float) -> Array:
        """(samples,) of plans (samples, stretches, 2)."""
        ways = self._joints(plans, env_id, turn)
        entities = np.asarray(self._object.slot.entities)
        body = self._roots[int(np.argmax(self.env.scene.presence[env_id, entities]))]
        self._rollouts.begin(env_id)
        tool = self.arm.command[env_id, :2] + np.cumsum(plans, axis=1) * STRETCH * self._dt
        cost = 0.02 * (plans**2).sum(axis=(1, 2))
        for stretch in range(STRETCHES):
            for part in range(1, STRETCH + 1):
                share = part / STRETCH
                self._rollouts.step(self._drives, (1 - share) * ways[:, stretch] + share * ways[:, stretch + 1])
            thing = self._rollouts.positions(body)[:, :2]
            left = goal - thing
            far = P.norm(left)
            behind = thing - radius * left / np.maximum(far, 1e-6)[:, None]
            last = 3.0 if stretch + 1 == STRETCHES else 1.0
            cost = cost + last * (far + BEHIND * np.minimum(1.0, far / 0.03) * P.norm(tool[:, stretch] - behind))
        return cost

    def _joints(self, plans: Array, env_id: int, turn: Array) -> Array:
        """(samples, stretches + 1, K) joint positions at the ends of the stretches."""
        arm, count = self.arm, len(plans)
        now = np.repeat(arm.joints[env_id][None], count, axis=0)
        base = np.repeat(self.env.scene.state.body_pose[[env_id], arm.chain.root], count, axis=0)
        keys = np.repeat(self.env.streams.episode_seed[[env_id]], count)
        target = np.repeat(arm.command[env_id][None], count, axis=0)
        target[:, 3:] = turn
        ways = [now]
        for stretch in range(STRETCHES):
            target[:, :2] += plans[:, stretch] * STRETCH * self._dt
            now = arm.solver.solve(target, base, now, random_restarts=0, rng_seeds=keys).joint_pos
            ways.append(now)
        return np.stack(ways, axis=1)
