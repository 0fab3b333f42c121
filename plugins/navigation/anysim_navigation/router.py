"""Router of a base: direct control and planned ways behind one channel, chosen by a mode in each env.

In mode ROUTE a way over the mesh of the env is followed by the dynamic window over the live occupancy scan. Near the
end of the way, and in mode DIRECT from the beginning, the base goes straight to its pose.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from copy import copy
from enum import IntEnum
from math import inf
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.scene import Frame, RobotView, SceneView
from anysim_navigation.agent import NoRoute
from anysim_navigation.beam_search import BeamSearch
from anysim_navigation.car_ways import car_way
from anysim_navigation.delay import later, seen_from
from anysim_navigation.dynamic_window import STEP, DynamicWindow, distances_of
from anysim_navigation.limits import SWAY, BaseKind, BaseLimits
from anysim_navigation.maps import NavMaps
from anysim_navigation.movers import Movers
from anysim_navigation.navmesh import NavMesh, length_of
from anysim_navigation.pose_control import PoseControl, in_frame
from anysim_navigation.progress import Progress
from anysim_navigation.robot_shape import agent_of
from anysim_sensors.occupancy import Grid, occupancy
from anysim_sensors.sight.eye import Eye
from anysim_sensors.tables import GeomPoses

ROOM = (0.12, 0.06, 0.04, 0.02)
"""[m] beyond its radius that ways keep from things: as much as makes following them easy, else what fits."""
NEAR = 0.35
"""[m] from its end a way is left for the straight line, if that is free."""
CAR_STOPS, STOPS_AMONG = 0.15, 0.22
"""[m] from its end a car has arrived: its heading there is that of the way. Among movers it need not come as near."""
CUSP, AMONG = 0.05, 0.15
"""[m] before it changes its direction a car may do so, likewise."""
REPLANS = 12
"""Ways in a row that did not bring a base nearer to its end before it gives up; a quarter where nobody moves."""
NEARER = 0.1
"""[m] of the way that count as nearer."""
WITHIN = 4.5
"""[m] from it, movers are looked at by a search."""
FREE, AWHILE = 0.9, 2.0
"""[m] nobody comes nearer than that, for so many seconds [s], where a base goes straight to its end among movers."""
SNAP = 0.6
"""[m] by which the base may stand off the mesh: something may have come near it."""


class Mode(IntEnum):
    """What a base does: it stands, goes straight to its pose, turns on the spot to its heading, or follows a way."""

    STAND = 0
    DIRECT = 1
    TURN = 2
    ROUTE = 3


class Errand(NamedTuple):
    """What a router knows of one env: its rows, and where the base is on its way."""

    rows: dict[str, Array]
    progress: Progress | None
    later: tuple[tuple[Array, float], ...]
    refused: str | None


class BaseRouter:
    """Velocities of a robot's base in all envs.

    Attributes:
        target: (N, 3) x, y [m] and yaw [rad] in the world.
        mode: (N,) of `Mode`.
        twist: (N, 3) what it was told last: forward, left [m/s] and turn [rad/s].
        refused: why there is no way, by env.
    """

    def __init__(
        self,
        scene: SceneView,
        robot: RobotView,
        frame: Frame,
        limits: BaseLimits,
        *,
        movers: Sequence[str] = (),
        margin: float = 0.12,
        close: float = 0.01,
    ) -> None:
        """`movers` are entities that move by themselves: they are foreseen, and are on a map while they stand."""
        world, n = scene.engine.world, scene.engine.num_envs
        self._scene, self._frame, self.limits = scene, frame, limits
        self.window = DynamicWindow(limits, margin=margin)
        self._pose_control = PoseControl(limits, close)
        agent = agent_of(world, robot.name, limits)
        self._maps = [NavMaps(world, agent._replace(radius=limits.radius + m), without=(robot.name,)) for m in ROOM]
        self._height = height = frame_pose(scene, frame)[2]
        self._grid = Grid((6.0, 6.0), 0.04, agent.step - height, agent.height - height)
        self._eye = Eye(scene, frame, "collision", "entity")
        searches = limits.kind is not BaseKind.HUMANOID  # which is too slow for it, and keeps from all of a person
        self.search = BeamSearch(limits) if movers and searches else None
        self._movers = Movers(scene, movers, agent.height if searches else inf, strides=searches)
        self._seen = self._eye.seen & self._eye.geometry.without(self._movers.bodies)
        self._every = max(1, round(STEP / world.physics.control_dt))
        self.target, self.twist = np.zeros((2, n, 3))
        self.mode = np.full(n, Mode.STAND, dtype=np.int64)
        self._told = np.zeros((n, round(limits.delay / STEP), 3))
        """Velocities that the base is yet to have, those of the next step first."""
        self._steps, self._replans = np.zeros((2, n), dtype=np.int64)
        self._least = np.full(n, np.inf)
        """(N,) [m] the least that was left of any way."""
        self._progress: list[Progress | None] = [None] * n
        self._gear = np.zeros(n)
        """Of a car on its way: 1 forwards, -1 backwards."""
        self._no_plan = self.search.no_plan if self.search else np.zeros(0, dtype=np.int64)
        self._plan = np.tile(self._no_plan, (n, 1))
        """What the search chose last."""
        self._later: list[list[tuple[Array, float]]] = [[] for _ in range(n)]
        """Of a car's way, the stretches beyond its next change of direction, and their gears."""
        self.refused: dict[int, str] = {}

    def go(self, ids: Array, target: Array, mode: Mode = Mode.ROUTE) -> None:
        """Go to x, y, yaw (n, 3) in these envs."""
        self.target[ids], self.mode[ids], self._steps[ids], self._replans[ids] = target, mode, 0, 0
        self._least[ids] = np.inf
        if mode is Mode.STAND:  # an episode begins so: it does not go on from what the last one ended with
            self.twist[ids], self._plan[ids], self._told[ids] = 0.0, self._no_plan, 0.0
        for env in ids.tolist():
            self._progress[env] = None
            self.refused.pop(env, None)

    def meshes(self, env: int) -> Iterator[NavMesh]:
        """The meshes of an env as it is now, that with the most room first."""
        return (maps.at(self._scene.state.body_pose[env], self._scene.presence[env]) for maps in self._maps)

    def velocities(self, ids: Array) -> Array:
        """(n, 3) what the base is to do now in these envs, which the scene looks at in this order."""
        here = pose_of(self._frame.pose)
        pose = later(here, self._told[ids])
        due = self._steps[ids] % self._every == 0
        self._steps[ids] += 1
        routed = self.mode[ids] == Mode.ROUTE
        if self._movers.names:  # who has come near its end may have to give way yet
            ends = [self._progress[env] is not None for env in ids.tolist()]
            routed |= (self.mode[ids] == Mode.DIRECT) & ends
        route = np.flatnonzero(due & routed)
        if len(route):
            self._tick(ids, route, here, pose)
        for row, env in enumerate(ids.tolist()):
            mode = self.mode[env]
            if mode == Mode.ROUTE:
                continue
            turn = P.wrapped(self.target[env, 2] - pose[row, 2])
            if mode == Mode.DIRECT:
                way = in_frame(pose[row], self.target[env : env + 1, :2])[0]
                self.twist[env] = self._pose_control.twist(way, turn, self.twist[env])
            else:
                self.twist[env] = self._pose_control.turning(turn) if mode == Mode.TURN else 0.0
        told = np.concatenate([self._told[ids[due]], self.twist[ids[due], None]], axis=1)
        self._told[ids[due]] = told[:, 1:]
        return self.twist[ids]

    def snapshot(self, ids: Array) -> tuple[Errand, ...]:
        """What it knows of these envs: with a snapshot of the env the drive goes on from here again."""
        rows = ({name: getattr(self, name)[env].copy() for name in _ROWS} for env in ids)
        return tuple(
            Errand(row, copy(self._progress[env]), tuple(self._later[env]), self.refused.get(env))
            for row, env in zip(rows, ids.tolist(), strict=True)
        )

    def restore(self, ids: Array, errands: Sequence[Errand]) -> None:
        """Go on in these envs with what a snapshot knew, row by row."""
        for env, one in zip(ids.tolist(), errands, strict=True):
            for name in _ROWS:
                getattr(self, name)[env] = one.rows[name]
            self._progress[env], self._later[env] = copy(one.progress), list(one.later)
            self.refused.pop(env, None)
            if one.refused is not None:
                self.refused[env] = one.refused

    # ------------------------------------------------------------------ a way is followed

    def _tick(self, ids: Array, rows: Array, here: Array, pose: Array) -> None:
        """From where bases are, and what is seen there; and from where they do what they are told now."""
        envs = ids[rows]
        for row, env in zip(rows.tolist(), envs.tolist(), strict=True):
            self._look(env, row, pose[row])
        going = [k for k, env in enumerate(envs.tolist()) if self._progress[env] is not None]
        if not going:
            return
        rows, envs = rows[going], envs[going]
        posed = GeomPoses(*(array[rows] for array in self._eye.posed))
        eyes = self._eye.poses[rows]
        if self.limits.kind in (BaseKind.HUMANOID, BaseKind.QUADRUPED):  # who bobs looks from above its lowest foot
            eyes[:, 2] = self._height + posed.low[:, ~self._eye.seen, 2].min(axis=1)
        cells = occupancy(self._eye.geometry, posed, eyes, self._grid, seen=self._seen)
        twist = self.twist[envs] if self.limits.kind in SWAY else in_base(self._frame.twist[rows], pose[rows])
        movers = self._movers.around(rows, pose[rows])
        movers[..., :2] += self.limits.delay * movers[..., 2:4]
        for k, env in enumerate(envs.tolist()):
            field = distances_of(cells[k], self._grid.cell)
            if self.limits.delay:
                field = seen_from(field, self._grid.cell, here[rows[k]], pose[rows[k]])
            self._steer(env, pose[rows[k]], field, twist[k], movers[k])

    def _look(self, env: int, row: int, pose: Array) -> None:
        """Where the base is on its way; a way is made where there is none, or it has become stale."""
        progress = self._progress[env]
        if progress is not None:
            progress.look(pose[:2], STEP)
            left = progress.left + sum(length_of(path) for path, _ in self._later[env])
            if left < self._least[env] - NEARER and progress.off < 0.3:
                self._replans[env], self._least[env] = 0, left
            if not progress.stale or progress.recovering > 0:
                return
        if self._replans[env] > (REPLANS if self._movers.names else REPLANS // 4):
            self._refuse(env, "the base does not get on along any way that it has tried")
            return
        try:
            path = self._way(env, row, pose)
        except NoRoute as reason:
            self._refuse(env, str(reason))
            return
        stuck = progress is not None
        made = self._progress[env] = Progress(path)
        made.look(pose[:2], 0.0)
        self._replans[env] += 1
        if stuck:
            made.recover()

    def _way(self, env: int, row: int, pose: Array) -> Array:
        """(K, 2) around movers that stand, or where there is no way so, through where they are.

        A car that people drove off its way may stand where none of a car begins: it gets one over the mesh, along which
        the search shunts it, until it is stale.
        """
        try:
            return self._way_past(env, self._movers.there(row, standing=True), pose)
        except NoRoute:
            if not self._movers.names:
                raise
        present = self._movers.there(row, standing=False)
        try:
            return self._way_past(env, present, pose)
        except NoRoute:
            if self.limits.kind is not BaseKind.ACKERMANN:
                raise
        self._gear[env], self._later[env] = 1.0, []
        return self._over_mesh(env, self._maps[-1], present, pose)

    def _way_past(self, env: int, present: Array, pose: Array) -> Array:
        """(K, 2) over the mesh with the most room, or over the tightest that has a way."""
        poses, end = self._scene.state.body_pose[env], self.target[env, :2]
        if self.limits.kind is BaseKind.ACKERMANN:
            mesh = self._maps[-1].at(poses, present)
            try:
                found = car_way(mesh, self.limits, pose, end, room=self._grid.cell)
            except NoRoute:
                found = car_way(mesh, self.limits, pose, end)
            (first, self._gear[env]), *self._later[env] = found
            return first
        for maps in self._maps[:-1]:
            with suppress(NoRoute):
                return self._over_mesh(env, maps, present, pose)
        return self._over_mesh(env, self._maps[-1], present, pose)

    def _over_mesh(self, env: int, maps: NavMaps, present: Array, pose: Array) -> Array:
        """(K, 2) from where the base is to where it is to be, at least two points."""
        start, end = pose[:2], self.target[env, :2]
        path = maps.at(self._scene.state.body_pose[env], present).path(start, end, snap=SNAP)
        return np.concatenate([start[None], path[1:-1], end[None]])

    def _refuse(self, env: int, why: str) -> None:
        self.refused[env], self._progress[env], self.twist[env] = why, None, 0.0
        self.mode[env] = Mode.STAND

    def _steer(self, env: int, pose: Array, field: Array, now: Array, movers: Array) -> None:
        progress = self._progress[env]
        assert progress is not None
        cell, end = self._grid.cell, self.target[env, :2]
        car = self.limits.kind is BaseKind.ACKERMANN
        close = movers[np.hypot(movers[:, 0], movers[:, 1]) < WITHIN]
        search = self.search if len(close) else None
        if car and float(np.hypot(*(end - pose[:2]))) < (STOPS_AMONG if search else CAR_STOPS):
            self.mode[env], self.twist[env] = Mode.STAND, 0.0  # it cannot turn on the spot, so there is nothing to do
            return
        if progress.left < NEAR and not car and _is_free(movers) and self._straight(field, pose, end):
            self.mode[env] = Mode.DIRECT
            way = in_frame(pose, end[None])[0]
            self.twist[env] = self._pose_control.twist(way, P.wrapped(self.target[env, 2] - pose[2]), self.twist[env])
            return
        self.mode[env] = Mode.ROUTE
        if self._later[env] and progress.left < (AMONG if search else CUSP):
            path, self._gear[env] = self._later[env].pop(0)
            progress = self._progress[env] = Progress(path)
            progress.look(pose[:2], 0.0)
        path, aim = self.window.ahead(progress, pose, field, cell, search.reach if search else None)
        gear = float(self._gear[env])
        if search:
            now = self.twist[env] if self.limits.kind is BaseKind.QUADRUPED else now  # a trot sways
            found = search.choose(field, cell, path, aim, now, close, gear, self._plan[env])
            self.twist[env], self._plan[env] = found.twist, found.plan
            return
        self._plan[env] = self._no_plan
        if progress.recovering > 0:
            aim, gear = _roomiest(field, cell, movers), 0.0
            path = aim[None]
        choice = self.window.choose(field, cell, path, aim, now, self.twist[env], movers, gear)
        self.twist[env] = choice.twist
        if self.limits.kind is BaseKind.DIFFERENTIAL and np.isfinite(choice.cost) and not choice.twist.any():
            bearing = float(np.arctan2(aim[1], aim[0]))
            self.twist[env] = self._pose_control.turning(bearing)  # who stands may turn

    def _straight(self, field: Array, pose: Array, end: Array) -> bool:
        """Whether the line to the end of the way is free on the scan."""
        from anysim_navigation.kernels.window import clearances

        way, discs, nobody = in_frame(pose, end[None])[0], self.limits.discs, np.zeros((0, 5))
        points = np.linspace(0.0, 1.0, 6)[1:, None] * way
        return all(clearances(field, self._grid.cell, discs, nobody, x, y, 0.0, 0.0)[0] > -0.02 for x, y in points)


_ROWS = ("target", "twist", "mode", "_steps", "_replans", "_least", "_gear", "_plan", "_told")


def pose_of(pose: Array) -> Array:
    """(n, 3) x, y [m] and yaw [rad] of poses (n, 7)."""
    return np.concatenate([pose[:, :2], P.yaw(pose[:, 3:])[:, None]], axis=1)


def in_base(twist: Array, pose: Array) -> Array:
    """(n, 3) forward, left and turn of twists (n, 6) of the world, in bases at poses (n, 3)."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    return np.stack([c * twist[:, 0] + s * twist[:, 1], c * twist[:, 1] - s * twist[:, 0], twist[:, 5]], axis=1)


def frame_pose(scene: SceneView, frame: Frame) -> Array:
    """(7,) of a frame in the world, as that begins."""
    at = scene.engine.index.frame(frame.name)
    return P.compose(scene.engine.world.initial_body_pose[at.body], np.array([*at.position, *at.quaternion]))


def _is_free(movers: Array) -> bool:
    """Whether nobody comes near for a while who goes on as he does."""
    times = np.linspace(0.0, AWHILE, 11)[:, None, None]
    return bool((np.linalg.norm(movers[:, :2] + times * movers[:, 2:4], axis=-1) > FREE).all())


def _roomiest(field: Array, cell: float, movers: Array) -> Array:
    """(2,) [m] the place at 0.35 m around the base that is furthest from everything, and from where movers will be."""
    from anysim_navigation.kernels.window import clearances

    turn = 2 * np.pi * np.arange(16) / 16
    places = 0.35 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    at = np.zeros((1, 3))
    return places[int(np.argmax([min(clearances(field, cell, at, movers, x, y, 0.0, 1.0)) for x, y in places]))]
