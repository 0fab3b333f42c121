"""Flying a camera: eased motion of joints to velocities or to places, within limits of speed and acceleration."""

from collections.abc import Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView, Command
from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import JointType
from anysim_cameras.controller import CameraController
from anysim_cameras.easing import brake_speed, minimum_jerk, move_time, room_speeds, shortened, toward

_STATE = ("position", "velocity", "target", "start", "goal", "elapsed", "duration")


class CameraMotion(CameraController):
    """Moves the joints of a channel smoothly, commanding their drives anew in every physics step.

    The action is a velocity for each joint [m/s, rad/s], or its place [m, rad]. The limits hold for the straight line
    of all sliding joints together and for each turning joint by itself. A place is gone to by minimum-jerk moves, each
    as short as the limits allow: a target that comes during a move waits for its end; `damped` follows targets at any
    time instead, as a damped spring does. A joint without limits turns to a place by the shorter way.
    """

    def __init__(
        self,
        channel: ChannelView,
        num_envs: int,
        *,
        command: Annotated[Literal["velocity", "pose"], Field(description="what the action is")] = "velocity",
        easing: Annotated[
            Literal["minimum_jerk", "damped"], Field(description="with `command: pose`: how a place is gone to")
        ] = "minimum_jerk",
        speed: Annotated[float, Field(gt=0, description="largest speed [m/s]")] = 2.0,
        acceleration: Annotated[float, Field(gt=0, description="largest acceleration [m/s^2]")] = 4.0,
        rate: Annotated[float, Field(gt=0, description="largest rate of a turning joint [rad/s]")] = 2.0,
        angular_acceleration: Annotated[float, Field(gt=0, description="and its acceleration [rad/s^2]")] = 6.0,
        response: Annotated[float, Field(gt=0, le=50, description="damped: how fast it settles [1/s]")] = 6.0,
    ) -> None:
        super().__init__(channel, num_envs)
        self.dim = k = len(channel)
        slides = [joint.type is JointType.PRISMATIC for joint in self.joints]
        together = np.flatnonzero(slides)
        self._groups = [(together, speed, acceleration)] if len(together) else []
        self._groups += [(np.array([i]), rate, angular_acceleration) for i in np.flatnonzero(~np.array(slides))]
        self.push, self.turn_push = acceleration, angular_acceleration
        self.command, self._damped, self._response = command, easing == "damped", response
        self._endless = ~(np.isfinite(channel.lower) & np.isfinite(channel.upper))
        if command == "velocity":
            self.high = np.array([speed if s else rate for s in slides])
            self.low = -self.high
        else:
            self.low = np.where(self._endless, -np.pi, channel.lower)
            self.high = np.where(self._endless, np.pi, channel.upper)
        groups = len(self._groups)
        self._rows |= {name: np.zeros((num_envs, groups if name in ("elapsed", "duration") else k)) for name in _STATE}

    def reset(self, env_ids: Array, targets: Array) -> None:
        for name, rows in self._rows.items():
            rows[env_ids] = targets if name in ("position", "target", "start", "goal") else 0.0

    def apply(self, action: Array, env_ids: Array | None) -> Command:
        rows = slice(None) if env_ids is None else env_ids
        if self.command == "pose":
            here = self._rows["goal" if not self._damped else "position"][rows]
            self._rows["target"][rows] = np.where(self._endless, here + P.wrapped(action - here), action)
        else:
            self._rows["target"][rows] = action
        return self.update(env_ids)

    def update(self, env_ids: Array | None) -> Command:
        rows = slice(None) if env_ids is None else env_ids
        state = {name: values[rows] for name, values in self._rows.items()}
        for number, group in enumerate(self._groups):
            if self.command == "velocity":
                self._cruise(state, *group)
            elif self._damped:
                self._settle(state, *group)
            else:
                self._ease(state, number, *group)
        for name, values in state.items():
            self._rows[name][rows] = values
        return Command(position=state["position"].copy(), velocity=state["velocity"].copy())

    # ------------------------------------------------------------------ one tick of a group of joints

    def _cruise(self, state: Mapping[str, Array], own: Array, speed: float, acceleration: float) -> None:
        """Towards a velocity, and no faster than what still stops before the joints' limits."""
        wanted, change = shortened(state["target"][:, own], speed), acceleration * self._dt
        braking = acceleration / len(own) ** 0.5  # so that all joints may have to stop at once
        low, high = room_speeds(
            state["position"][:, own], self.channel.lower[own], self.channel.upper[own], braking, self._dt
        )
        velocity = state["velocity"][:, own]
        kept = np.minimum(np.maximum(velocity, -low), high)  # braking comes first, the rest of the change after it
        left = np.maximum(change - P.norm(kept - velocity), 0.0)
        self._go(state, own, toward(kept, np.minimum(np.maximum(wanted, -low), high), left))

    def _settle(self, state: Mapping[str, Array], own: Array, speed: float, acceleration: float) -> None:
        """Towards a place, no faster than what still stops there."""
        way = state["target"][:, own] - state["position"][:, own]
        distance = P.norm(way)
        pace = np.minimum(speed, brake_speed(distance, acceleration, self._response))
        wanted = way * (pace / np.maximum(distance, 1e-12))[:, None]
        self._go(state, own, toward(state["velocity"][:, own], wanted, acceleration * self._dt))

    def _go(self, state: Mapping[str, Array], own: Array, velocity: Array) -> None:
        there = state["position"][:, own] + velocity * self._dt
        kept = np.minimum(np.maximum(there, self.channel.lower[own]), self.channel.upper[own])
        state["velocity"][:, own] = np.where(kept == there, velocity, 0.0)
        state["position"][:, own] = kept

    def _ease(self, state: Mapping[str, Array], number: int, own: Array, speed: float, acceleration: float) -> None:
        """Along a minimum-jerk move; a new one begins where the last has ended."""
        elapsed, duration = state["elapsed"][:, number], state["duration"][:, number]
        differs = (state["target"][:, own] != state["goal"][:, own]).any(axis=1)
        begins = (elapsed >= duration) & differs
        state["start"][:, own] = np.where(begins[:, None], state["position"][:, own], state["start"][:, own])
        state["goal"][:, own] = np.where(begins[:, None], state["target"][:, own], state["goal"][:, own])
        way = state["goal"][:, own] - state["start"][:, own]
        length = P.norm(way)
        ticks = np.ceil(move_time(length, speed, acceleration) / self._dt)  # ends with a tick, so that it is at rest
        duration = np.where(begins, ticks, duration)
        elapsed = np.minimum(np.where(begins, 0.0, elapsed) + 1.0, duration)
        still = duration == 0.0
        share = np.where(still, 1.0, elapsed / np.maximum(duration, 1.0))
        done, pace = minimum_jerk(share)
        seconds = np.maximum(duration, 1.0) * self._dt
        state["elapsed"][:, number], state["duration"][:, number] = elapsed, duration
        arrived = (share >= 1.0)[:, None]
        state["position"][:, own] = np.where(
            arrived, state["goal"][:, own], state["start"][:, own] + done[:, None] * way
        )
        state["velocity"][:, own] = np.where(arrived, 0.0, (pace / seconds)[:, None] * way)

    # ------------------------------------------------------------------ the rest of the contract

    def action_for(self, targets: Array, env_ids: Array) -> Array:
        if self.command != "pose":
            return super().action_for(targets, env_ids)
        turned = np.where(self._endless, P.wrapped(targets), targets)
        return np.minimum(np.maximum(turned, self.low), self.high)
