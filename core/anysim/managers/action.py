"""ActionManager: the slices of the action vector, the controllers behind them, and what they command of the drives."""

from collections.abc import Mapping
from math import gcd, isfinite
from typing import Any, NamedTuple

import numpy as np

from anysim import registry
from anysim.controllers.action_space import ActionSpaces, ChannelSpace, component_labels
from anysim.controllers.base import DEFAULT_CONTROLLER, ChannelView, Command, Controller
from anysim.controllers.robot import ControlledRobot
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.snapshots.row_checks import refuse_range
from anysim.errors import SpecError, SpecIssue, TaskError, listing, suggest
from anysim.managers.base import WORLD, Manager, Overridable, random_fields
from anysim.math import arrays
from anysim.model.world import ControlMode, World
from anysim.plugin_parameters import options_model
from anysim.randomization.draw import DelayLine, draw_rows, longest_delay, noise_rows, note_noise
from anysim_schemas.robots import ActionSpec


class ActionSlice(NamedTuple):
    """Which columns of the action belong to a channel."""

    robot: str
    channel: str
    start: int
    stop: int
    controller: Controller
    spec: ActionSpec
    line: DelayLine | None
    """What was asked for in the last steps, where it acts late."""
    steps: int | None
    """Physics steps between two updates of the controller; None for none within a control step."""
    blame: registry.Blame
    """Names the channel, the controller and its distribution where it raises."""


class ActionManager(Manager):
    """The controllers of all robots of an env. The action is one flat vector: robots in order, then their channels.

    Attributes:
        slices: which columns belong to which channel, and its controller.
        spaces: what each channel takes, by `robot.channel`.
        dim, low, high: the number of components, and their bounds (A,).
        schedule: physics steps of a control step, in the parts between which `update` is called.
    """

    name = "action"

    def build(self, world: World) -> None:
        self._world = world
        self._views: list[ChannelView] = []
        self._robots: list[ControlledRobot] = []
        issues: list[SpecIssue] = []
        for robot in world.robots:
            controlled = ControlledRobot(world, robot.name, self.streams)
            self._robots.append(controlled)
            for name in self.spec.world.robots[robot.name].actions:
                channel = robot.channels.get(name)
                if channel is None:
                    hint = suggest(name, list(robot.channels))
                    words = f"{robot.model} has no such channel{hint} (channels: {listing(robot.channels)})"
                    issues.append(SpecIssue("", f"world.robots.{robot.name}.actions.{name}", words))
                    continue
                self._views.append(ChannelView.of(world, channel, controlled))
        if issues:
            raise SpecError(issues)

    def bind(self, engine: SimEngine) -> None:
        """Make the controllers."""
        super().bind(engine)
        n, physics = engine.num_envs, self._world.physics
        self.slices: list[ActionSlice] = []
        start = 0
        for view in self._views:
            robot = view.robot.name
            action = self.spec.world.robots[robot].actions[view.name]
            controller = _make(view, action, n)
            longest = longest_delay(action.delay)
            line = DelayLine(n, controller.dim, longest) if longest else None
            stop, steps = start + controller.dim, _steps(controller, physics.dt)
            key = self.located(f"world.robots.{robot}.actions.{view.name}")
            who = f"{key}: the controller {type(controller).__name__}"
            blame = registry.Blame(who, registry.origin(controller), prefix=True)
            self.slices.append(ActionSlice(robot, view.name, start, stop, controller, action, line, steps, blame))
            start = stop
        self.dim = start
        self.spaces = ActionSpaces({f"{s.robot}.{s.channel}": self._space(s) for s in self.slices})
        self.low = np.concatenate([s.controller.low for s in self.slices] or [np.zeros(0)])
        self.high = np.concatenate([s.controller.high for s in self.slices] or [np.zeros(0)])
        tick = gcd(physics.substeps, *(s.steps for s in self.slices if s.steps is not None))
        self._tick = tick if any(s.steps is not None for s in self.slices) else physics.substeps
        self.schedule = (self._tick,) * (physics.substeps // self._tick)
        drives = len(self._world.actuators)
        self._position = engine.control.position
        self._velocity, self._effort = np.zeros((n, drives)), np.zeros((n, drives))
        self._support = np.zeros((len(self.slices), n, drives))
        self._feeds = False
        """Whether any controller ever commanded more than positions."""
        self._obeying: list[Array | None] = [None] * len(self.slices)

    def _space(self, s: ActionSlice) -> ChannelSpace:
        names = [self._world.actuators[a].name.removeprefix(f"{s.robot}.") for a in s.controller.channel.actuators]
        labels = component_labels(s.controller, names)
        return ChannelSpace(s.controller.low.copy(), s.controller.high.copy(), labels, s.start, s.stop)

    def slice_of(self, robot: str, channel: str) -> ActionSlice:
        """The part of the action that belongs to a robot's channel.

        Raises:
            TaskError: the world gives that channel no controller.
        """
        for s in self.slices:
            if (s.robot, s.channel) == (robot, channel):
                return s
        known = [f"{s.robot}.{s.channel}" for s in self.slices]
        raise TaskError(
            f"'{robot}.{channel}' has no controller; add world.robots.{robot}.actions.{channel} "
            f"(channels with one: {listing(known)})"
        )

    def validated(self, action: Any) -> Array:
        """The action, flat (N, A) or by channel, as float64 (N, A), clipped to the channels' bounds.

        Raises:
            TaskError: another shape, a channel that is unknown or missing, or a value that is not finite.
        """
        if isinstance(action, Mapping):
            action = self.spaces.flatten(action, self.engine.num_envs)
        array = arrays.numbers("the action", action, TaskError)
        if array.shape != (self.engine.num_envs, self.dim):
            raise TaskError(f"the action must have shape ({self.engine.num_envs}, {self.dim}), got {array.shape}")
        clipped = np.minimum(np.maximum(array, self.low), self.high)
        if not isfinite(np.vdot(clipped, clipped)) and not np.isfinite(clipped).all():
            raise TaskError("the action holds a value that is not a number")
        return clipped

    # ------------------------------------------------------------------ reset

    def reset(self, env_ids: Array) -> None:
        """All drives hold what they are commanded now, where the robots begin, in the modes of their controllers."""
        targets = self.engine.control.position[env_ids]
        self._position[env_ids] = targets
        self._velocity[env_ids] = 0.0
        self._effort[env_ids] = 0.0
        self._support[:, env_ids] = 0.0
        self._see()
        for s in self.slices:
            self._reset_imperfections(s, env_ids)
            self._set_modes(s.controller, env_ids)
            with s.blame:
                s.controller.reset(env_ids, targets[:, s.controller.channel.actuators])
        self._write(env_ids)

    def overridable(self) -> list[Overridable]:
        return [
            entry
            for robot, spec in self.spec.world.robots.items()
            for channel, action in spec.actions.items()
            for entry in random_fields(f"{WORLD}robots.{robot}.actions.{channel}", action, ("delay",))
        ]

    def _set_modes(self, controller: Controller, env_ids: Array) -> None:
        drives, mode = controller.channel.actuators, controller.mode
        modes = (mode,) * len(drives) if isinstance(mode, ControlMode) else mode
        for wanted in dict.fromkeys(modes):
            own = [int(d) for d, m in zip(drives, modes, strict=True) if m is wanted]
            if any(self._world.actuators[d].mode is not wanted for d in own):
                self.engine.set_control_mode(wanted, env_ids, own)

    def _reset_imperfections(self, s: ActionSlice, env_ids: Array) -> None:
        """Draw the delay of a channel, and say that it has noise."""
        stream, path = f"robot/{s.robot}/{s.channel}", f"world.robots.{s.robot}.actions.{s.channel}"
        if s.line is not None:
            delay = draw_rows(s.spec.delay, f"{stream}/delay", self.streams, env_ids, source=f"{path}.delay")
            s.line.reset(env_ids, delay.astype(np.int64))
        note_noise(s.spec.noise, f"{stream}/noise", self.streams, env_ids, f"{path}.noise")

    # ------------------------------------------------------------------ acting

    def act(self, action: Array, env_ids: Array | None) -> None:
        """Turn actions (N, A) into commands of all envs, or of `env_ids`; the others keep their commands."""
        self._see()
        for number, s in enumerate(self.slices):
            rows = action[:, s.start : s.stop] if env_ids is None else action[env_ids, s.start : s.stop]
            rows, obeying = self._imperfect(s, rows, env_ids)
            self._obeying[number] = obeying
            if obeying is not None and len(obeying) == 0:
                continue
            with s.blame:
                self._take(number, s.controller.apply(rows, obeying), obeying)
        if self.slices:
            self._write(None)

    def update(self, part: int) -> None:
        """Before part 1, 2, … of `schedule`: the controllers that are due command again."""
        self._see()
        for number, s in enumerate(self.slices):
            obeying = self._obeying[number]
            if s.steps is None or part * self._tick % s.steps or (obeying is not None and len(obeying) == 0):
                continue
            with s.blame:
                self._take(number, s.controller.update(obeying), obeying)
        self._write(None)

    def _see(self) -> None:
        state = self.engine.get_state()
        for robot in self._robots:
            robot.see(state)

    def _take(self, number: int, command: Command, env_ids: Array | None) -> None:
        """Note what a controller wants of its drives."""
        if command.__class__ is not Command:
            raise TaskError(f"a controller returns an anysim.controllers.base.Command, not {type(command).__name__}")
        channel = self.slices[number].controller.channel
        for buffer, values in (
            (self._position, command.position),
            (self._velocity, command.velocity),
            (self._effort, command.effort),
        ):
            if values is not None:
                _put(buffer, values, env_ids, channel.columns, channel.actuators)
        if command.robot_effort is not None:
            drives = channel.robot.drives
            _put(self._support[number], command.robot_effort, env_ids, drives, drives)
        self._feeds |= command.velocity is not None or command.effort is not None or command.robot_effort is not None

    def _write(self, env_ids: Array | None) -> None:
        """Give the engine the commands."""
        rows = slice(None) if env_ids is None else env_ids
        if not self._feeds:
            self.engine.set_control(position=self._position[rows], env_ids=env_ids)
            return
        effort = self._effort[rows] + self._support[:, rows].sum(axis=0)
        self.engine.set_control(self._position[rows], self._velocity[rows], effort, env_ids)

    def _imperfect(self, s: ActionSlice, rows: Array, env_ids: Array | None) -> tuple[Array, Array | None]:
        """What reaches the controller of what was asked for, and the envs for which anything does by now."""
        if s.line is None and s.spec.noise is None:
            return rows, env_ids
        ids = np.arange(self.engine.num_envs) if env_ids is None else env_ids
        if s.line is not None:
            ticks = self.episodes.elapsed[ids]
            s.line.write(ids, ticks, rows)
            there = s.line.arrived(ids, ticks)
            rows = s.line.read(ids, ticks)[there]
            ids, env_ids = ids[there], env_ids if there.all() else ids[there]
        if s.spec.noise is not None:
            name = f"robot/{s.robot}/{s.channel}/noise"
            ticks = self.episodes.elapsed[ids]
            noisy = rows + noise_rows(s.spec.noise, name, self.streams, ids, ticks, rows.shape[1])
            rows = np.clip(noisy, s.controller.low, s.controller.high)
        return rows, env_ids

    # ------------------------------------------------------------------ snapshots

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of commands, delayed actions and controllers' own state."""
        data = {
            "targets": self._position[env_ids],
            "velocities": self._velocity[env_ids],
            "efforts": self._effort[env_ids],
            "support": self._support[:, env_ids].swapaxes(0, 1).copy(),
        }
        for s in self.slices:
            if s.line is not None:
                data[f"delayed.{s.robot}.{s.channel}.delay"] = s.line.delay[env_ids]
                data[f"delayed.{s.robot}.{s.channel}.rows"] = s.line.rows[env_ids]
            data |= {f"{s.robot}.{s.channel}.{k}": v for k, v in s.controller.snapshot(env_ids).items()}
        return data

    def refuse_rows(self, data: Mapping[str, Array]) -> None:
        """Delays that no line has."""
        for s in self.slices:
            if s.line is not None:
                name = f"delayed.{s.robot}.{s.channel}.delay"
                refuse_range(name, data[name], 0, s.line.rows.shape[1] - 1)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""
        self._position[env_ids] = data["targets"]
        self._velocity[env_ids], self._effort[env_ids] = data["velocities"], data["efforts"]
        self._support[:, env_ids] = data["support"].swapaxes(0, 1)
        self._feeds |= any(data[key].any() for key in ("velocities", "efforts", "support"))
        for s in self.slices:
            if s.line is not None:
                s.line.delay[env_ids] = data[f"delayed.{s.robot}.{s.channel}.delay"]
                s.line.rows[env_ids] = data[f"delayed.{s.robot}.{s.channel}.rows"]
            prefix = f"{s.robot}.{s.channel}."
            s.controller.restore(env_ids, {k[len(prefix) :]: v for k, v in data.items() if k.startswith(prefix)})


def _make(view: ChannelView, action: ActionSpec, num_envs: int) -> Controller:
    """The controller of a channel, with the parameters of the world, else the catalogue's, else its own."""
    suited = view.robot.entry.channels[view.name].controllers
    name = action.controller
    where = f"world.robots.{view.robot.name}.actions.{view.name}"
    if name == DEFAULT_CONTROLLER:
        if not suited:
            words = f"the catalogue gives '{view.robot.entry.name}' no controller for '{view.name}'; name one"
            raise SpecError(
                [SpecIssue("", where, f"{words} (installed: {listing(registry.names('controllers'), 20)})")]
            )
        name = next(iter(suited))
    made: type[Controller] = registry.load("controllers", name)
    given: dict[str, Any] = {**suited.get(name, {}), **action.params}
    params = options_model(made).model_validate(given)
    try:
        return made(view, num_envs, **{key: getattr(params, key) for key in type(params).model_fields})
    except TaskError as error:
        raise TaskError(f"{where}: {error}") from None
    except BaseException as error:  # noqa: BLE001 - told with the key
        registry.blame(error, f"{where}: the controller '{name}'", registry.origin(made))


def _steps(controller: Controller, dt: float) -> int | None:
    """Physics steps between two updates of a controller."""
    return None if controller.period is None else max(1, round(controller.period / dt))


def _put(buffer: Array, values: Array, env_ids: Array | None, columns: slice | Array, indices: Array) -> None:
    if env_ids is None:
        buffer[:, columns] = values
    else:
        buffer[env_ids[:, None], indices] = values
