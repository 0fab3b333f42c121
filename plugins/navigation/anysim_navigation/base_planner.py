"""The base planner `dynamic_window`: a base that skills send somewhere, driven along a way around things."""

from collections.abc import Sequence
from math import tan
from typing import Any, ClassVar

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.task.env import TaskEnv
from anysim.task.scene import RobotView
from anysim_navigation.limits import OUTPUTS, SWAY, BaseKind, BaseLimits, kind_of, limits_of, output_of
from anysim_navigation.movers import movers_of
from anysim_navigation.progress import PATIENCE, RECOVERY
from anysim_navigation.robot_shape import discs_of
from anysim_navigation.router import REPLANS, BaseRouter, Mode, frame_pose
from anysim_navigation.way_costs import way_lengths
from anysim_schemas.vehicle import AckermannSpec
from anysim_skills.moving.base import Base


class PlannedBase(Base):
    """A base whose limits are those of its channel's controller, which come from the robot's entry in the catalogue.

    The pace of the skill that first sends it somewhere may be less.

    Attributes:
        router: of its ways, once a skill has sent it somewhere.
    """

    drives: ClassVar[tuple[tuple[str, ...], ...]] = tuple({labels for each in OUTPUTS.values() for labels in each})
    planned: ClassVar[bool] = True

    def __init__(self, env: TaskEnv, robot: RobotView, channel: str, link: str) -> None:
        super().__init__(env, robot, channel, link)
        self._robot, self._wheelbase = robot, 1.0
        self._labels = tuple(self._slice.controller.labels)
        self.router: BaseRouter | None = None
        self._named: tuple[str, ...] | None = None
        self._wait(1)  # it recovers by itself first

    def _wait(self, ways: int) -> None:
        """Have skills let it try so many ways more before they say that something holds it."""
        self.held_up += round(ways * (PATIENCE + RECOVERY) / self.env.engine.world.physics.control_dt)

    def foresee(self, movers: Sequence[str]) -> None:
        if self.router is not None:
            raise TaskError(f"the base of '{self._robot.name}' drives already: movers are named before")
        self._named = movers_of(self.env.engine.world, self._robot.name, (*(self._named or ()), *movers))

    def go(self, ids: Array, target: Array) -> None:
        super().go(ids, target)
        self._made().go(ids, target, Mode.ROUTE)
        self.no_way[ids] = False

    def way_lengths(self, ids: Array, at: Array, places: Array) -> Array:
        return way_lengths(self._made(), ids, self.pose(at), places)

    def _made(self) -> BaseRouter:
        if self.router is None:
            movers = movers_of(self.env.engine.world, self._robot.name, self._named)
            scene, limits = self.env.scene, self._limits()
            if movers:  # who stands may let somebody pass; the router says when it gives up
                self._wait(REPLANS)
            self.router = BaseRouter(scene, self._robot, self.frame, limits, movers=movers, close=self.close)
        return self.router

    def renew(self, ids: Array) -> None:
        super().renew(ids)
        if self.router is not None:
            self.router.go(ids, np.zeros((len(ids), 3)), Mode.STAND)

    def act(self, ids: Array, action: Array) -> None:
        twist = np.zeros((len(ids), 3)) if self.router is None else self.router.velocities(ids)
        limits = self._limits() if self.router is None else self.router.limits
        if self.router is not None:
            self.no_way[list(self.router.refused)] = True
        action[ids, self._slice.start : self._slice.stop] = output_of(limits, self._labels, twist, self._wheelbase)

    def _limits(self) -> BaseLimits:
        entry, controller = self._robot.model.entry, self._slice.controller
        vehicle = None if entry is None else entry.vehicle
        car = vehicle if isinstance(vehicle, AckermannSpec) else None  # which may be steered by its rate of turning
        kind = BaseKind.ACKERMANN if car else kind_of(self._labels, 0 if entry is None else len(entry.legs))
        shape = self.env.engine.world, self._robot.name, frame_pose(self.env.scene, self.frame)
        discs = discs_of(*shape, 3 if car else 1, SWAY.get(kind, 0.0))  # who cannot turn on the spot needs no room to
        most, least = np.array(controller.high, dtype=float), np.array(controller.low, dtype=float)
        options: dict[str, Any] = {}
        if car:
            self._wheelbase = car.wheelbase
            options["turning_radius"] = car.wheelbase / tan(car.max_steering)
            most[1] = most[0] / options["turning_radius"]
        if self._labels == ("forward", "left", "turn"):
            options["side"] = min(self.pace.speed, float(most[1]))
        options["back"] = min(self.pace.speed, float(-least[0]))
        speed, turn = min(self.pace.speed, float(most[0])), min(self.pace.rate, float(most[-1]))
        return limits_of(kind, discs, speed=speed, turn=turn, delay=controller.delay, **options)
