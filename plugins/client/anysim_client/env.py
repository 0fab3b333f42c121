"""Env of a service: the methods of `TaskEnv`, whose work is done elsewhere, with the same results to the bit."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from anysim.api import load
from anysim.controllers.action_space import ActionSpaces, ChannelSpace
from anysim.conventions import Array
from anysim.engine import arguments
from anysim.errors import SnapshotError, TaskError
from anysim.math import arrays
from anysim.task.contract import STATUS_NAMES, Obs, StepResult
from anysim.task.snapshot import EnvSnapshot
from anysim_client.errors import ServiceError
from anysim_client.link import Link
from anysim_client.messages import Chunk, from_jpegs, snapshot_data, snapshot_of
from anysim_client.served_env import ServedEnv
from anysim_client.shared import MARK, SharedSlots
from anysim_schemas.run import RunSpec

STAYS = frozenset(
    "managers actions capture families sensors bindings mdp counterfactuals located physics_seconds".split()
)
"""Attributes of a TaskEnv that the service keeps to itself."""


class _Physics(NamedTuple):
    control_dt: float


class _World(NamedTuple):
    """What is known of a world that is elsewhere."""

    name: str
    hash: str
    physics: _Physics


class _Engine(NamedTuple):
    """What is known of an engine that is elsewhere."""

    name: str
    version: str
    num_envs: int
    world: _World


class RemoteEnv(ServedEnv):
    """The env of a session. It belongs to the thread that uses it, as a TaskEnv does.

    What a TaskEnv is made of (`managers`, `mdp`, …) stays with the service; `details` tells what they know.

    Attributes:
        name, num_envs, action_dim, observation_sizes, image_shapes: as of a TaskEnv.
        engine: its `name` and `version`, and of its `world` the `name`, the `hash` and `physics.control_dt`.
        scene: `elapsed` (N,) control steps, and `terrain`, which is None.
        streams: `seed` and `episode_seed`.
        latest: of each env what `details` tells, as of the last step, where it was asked for with `full`.
        link: the session, and the connection to it.
        source: what the session is of, by the service's name for it.
    """

    def __init__(self, link: Link, images: str = "auto", quality: int = 90, full: bool = False) -> None:
        """`images` are sent `raw`, as `jpeg` of a `quality`, or `shared` in memory; `auto` shares where that can be."""
        if images not in ("auto", "raw", "jpeg", "shared"):
            raise TaskError(f"images are sent auto, raw, jpeg or shared, not {arrays.shown(images)}")
        self.link, spec = link, link.spec
        super().__init__(int(spec["num_envs"]))
        self.name, self.source = str(spec["task"]), str(spec["source"])
        self._low, self._high = (np.array(spec["action"][end], dtype=float) for end in ("low", "high"))
        self.action_dim = len(self._low)
        self.observation_sizes = {name: int(size) for name, size in spec["observations"].items()}
        self.image_shapes = {name: tuple(shape) for name, (shape, _) in spec["images"].items()}
        self.engine = _Engine(
            spec["engine"],
            spec["engine_version"],
            self.num_envs,
            _World(spec["world"], spec["world_hash"], _Physics(spec["control_dt"])),
        )
        self.streams = _Streams(self)
        self.latest: list[dict[str, Any]] = []
        self._form = {"images": "jpeg", "quality": quality} if images == "jpeg" else {}
        self._full = full or None
        self._shared: SharedSlots | None = None
        self._obs: dict[str, Array | None] = {}
        """The latest of all envs; None where a caller has it, in shared memory."""
        self._slot: int | None = None
        self._stale = True
        if images in ("auto", "shared") and self.image_shapes:
            self._negotiate()
            if images == "shared" and self._shared is None:
                self.close()
                raise ServiceError("the service is not on this machine, or has no room: its images cannot be shared")

    def _negotiate(self) -> None:
        terms = self.link.call("share")
        if not terms:
            return
        found = SharedSlots.found(terms)
        agreed = self.link.call("share", proof=np.zeros(0, np.uint8) if found is None else found.proof)["shared"]
        if found is not None and agreed:
            self._shared = found
        elif found is not None:
            found.close()

    # ------------------------------------------------------------------ facts

    @property
    def shares_memory(self) -> bool:
        """Whether images come through memory that is shared with the service."""
        return self._shared is not None

    @cached_property
    def spec(self) -> RunSpec:
        """The whole spec that the service runs; its terms must be installed here too."""
        return load(self.link.spec["spec"]).spec

    @property
    def action_bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds (A,) of the action."""
        return self._low.copy(), self._high.copy()

    @cached_property
    def action_spaces(self) -> ActionSpaces:
        """What each channel takes, by `robot.channel`, in the order of the flat action."""
        channels: dict[str, ChannelSpace] = {}
        for name, space in self.link.spec["action"]["channels"].items():
            low, start = np.array(space["low"], dtype=float), int(space["start"])
            labels = tuple(space["labels"])
            channels[name] = ChannelSpace(low, np.array(space["high"], dtype=float), labels, start, start + len(low))
        return ActionSpaces(channels)

    @property
    def obs(self) -> Obs:
        """The latest observation of all envs, as after the last reset or step."""
        self._refresh()
        if missing := [name for name, rows in self._obs.items() if rows is None]:
            seen = self.observe(missing)
            return {name: seen[name] if rows is None else rows.copy() for name, rows in self._obs.items()}
        return {name: rows.copy() for name, rows in self._obs.items() if rows is not None}

    @property
    def codes(self) -> Array:
        """(N,) int8, the place of each env's word in `Status`."""
        self._refresh()
        return self._code.copy()

    def observe(self, keys: Sequence[str]) -> Obs:
        """Some groups and images of the latest observation of all envs, asked of the service."""
        return self._rows(self.ask("observe", keys=list(keys), **self._form), np.arange(self.num_envs))

    def details(self) -> list[dict[str, Any]]:
        """Everything that the service knows of each env's episode, by name.

        `instruction`, `status`, `held`, `draws`, `overridden`, `bindings`; `goals` and `poses` (7,) [m, xyzw] by name;
        `sensors`, what is recorded of them.
        """
        return self.ask("info")["details"]

    def sensor_rows(self, env_ids: Array) -> dict[str, Array]:
        """What is recorded of sensors and families (n, …), by the names of the arrays."""
        rows = [one["sensors"] for one in self.details()]
        return {name: np.stack([np.asarray(rows[i][name]) for i in env_ids]) for name in rows[0]}

    # ------------------------------------------------------------------ episodes

    def reset(
        self,
        *,
        seed: int | Sequence[int] | None = None,
        mask: Array | None = None,
        episode_seeds: Sequence[int] | Array | None = None,
        overrides: Any = None,
    ) -> tuple[Obs, dict[str, Array]]:
        """Start new episodes in all envs, or where `mask` (N,) is true; as `TaskEnv.reset`."""
        ids = arrays.chosen(mask, self.num_envs, TaskError)
        answer = self.ask(
            "reset", seed=_plain(seed), mask=mask, episode_seeds=_plain(episode_seeds), overrides=_plain(overrides)
        )
        obs = self._rows(answer, ids)
        return obs, {name: rows[ids] for name, rows in self._info.items()}

    def step(self, action: Any, mask: Array | None = None) -> StepResult:
        """One control step of all envs, or only where `mask` (N,) is true; as `TaskEnv.step`."""
        self.begin_step(action, mask)
        return self.end_step()

    def begin_step(self, action: Any, mask: Array | None = None) -> None:
        """Ask for a step; `end_step` waits for it. In between nothing else may be asked."""
        given = {k: np.asarray(v) for k, v in action.items()} if isinstance(action, Mapping) else np.asarray(action)
        self._stale = True
        self._send("step", action=given, mask=mask, full=self._full, **self._form)

    def end_step(self) -> StepResult:
        """What the step gave."""
        answer = self._heard()
        self.latest = answer.get("details", self.latest)
        obs = self._rows(answer, np.arange(self.num_envs))
        return StepResult(obs, answer["reward"], STATUS_NAMES[self._code], self.info)

    def step_chunk(self, actions: Any) -> Chunk:
        """Several control steps with actions (N, K, A) in one message; envs that end wait for the others."""
        answer = self.ask("step_chunk", actions=np.asarray(actions), **self._form)
        obs = self._rows(answer, np.arange(self.num_envs))
        return Chunk(obs, answer["reward"], STATUS_NAMES[answer["codes"]], self.info, answer["steps"])

    def retire(self, env_ids: Array) -> None:
        """End episodes that are given up: these envs are truncated now if they were running."""
        self.ask("retire", env_ids=np.asarray(env_ids))

    def snapshot(self, mask: Array | None = None) -> EnvSnapshot:
        """Envs at this moment; it can be put into a local env of the same task, and the other way round."""
        return snapshot_of(self.ask("snapshot", mask=mask)["snapshot"])

    def reset_to(
        self, snapshot: EnvSnapshot, env_ids: Sequence[int] | Array | None = None, overrides: Any = None
    ) -> Obs:
        """Put a snapshot's envs into `env_ids` (default: all, in order); returns their observations."""
        if not isinstance(snapshot, EnvSnapshot):
            raise SnapshotError(f"reset_to() takes what snapshot() of an env gives, got a {type(snapshot).__name__}")
        ids = np.arange(self.num_envs) if env_ids is None else arguments.indices(env_ids, self.num_envs, "env")
        chosen = None if env_ids is None else ids
        answer = self.ask("reset_to", snapshot=snapshot_data(snapshot), env_ids=chosen, overrides=_plain(overrides))
        return self._rows(answer, ids)

    def render(
        self,
        camera: str | None = None,
        env_ids: Sequence[int] | Array | None = None,
        *,
        size: tuple[int | None, int | None] = (None, None),
        markers: bool = True,
    ) -> Array:
        """Images (E, H, W, 3) uint8 of a camera; as `TaskEnv.render`."""
        chosen = None if env_ids is None else arguments.indices(env_ids, self.num_envs, "env")
        sides = size if isinstance(size, Sequence) else (None, None, None)
        answer = self.ask("render", camera=camera, env_ids=chosen, size=list(sides), markers=markers, **self._form)
        images = answer["images"]
        return from_jpegs(images) if isinstance(images, dict) else images

    # ------------------------------------------------------------------ what is asked, and what is kept of it

    def ask(self, op: str, **sent: Any) -> dict[str, Any]:
        """The answer to an operation of the protocol."""
        self._stale = self._stale or op not in ("snapshot", "render", "info", "observe")
        self._send(op, **sent)
        return self._heard()

    def _send(self, op: str, **sent: Any) -> None:
        if self._shared is not None and self._slot is None:
            self._slot = self._shared.slot()
        self.link.send(op, slot=self._slot, **sent)

    def _heard(self) -> dict[str, Any]:
        answer = self.link.receive()
        if "running" in answer:
            self._code, self._running, self._info = answer["code"], answer["running"], answer["info"]
        return answer

    def _refresh(self) -> None:
        """See the envs anew where the last thing that was asked failed half-way, or nothing was asked yet."""
        if self._stale:
            self._rows(self.ask("observe", **self._form), np.arange(self.num_envs))

    def _rows(self, answer: Mapping[str, Any], ids: Array) -> Obs:
        """Observations of some envs; they are kept, and what is returned is not written to later."""
        obs: Obs = {}
        leased: dict[str, Array] = {}
        for name, rows in answer["obs"].items():
            if isinstance(rows, dict) and MARK in rows:
                if not leased and self._shared is not None and self._slot is not None:
                    leased, self._slot = self._shared.arrays(self._slot), None
                obs[name], self._obs[name] = leased[name], None
                continue
            obs[name] = from_jpegs(rows) if isinstance(rows, dict) else rows
            if self._obs.get(name, 0) is None:  # a caller has the others, who may have changed them
                continue
            kept = self._obs.get(name)
            if len(ids) == self.num_envs and np.array_equal(ids, np.arange(self.num_envs)):
                self._obs[name] = obs[name].copy()
                continue
            seen = obs[name]
            fresh = np.zeros((self.num_envs, *seen.shape[1:]), seen.dtype) if kept is None else kept.copy()
            fresh[ids] = seen
            self._obs[name] = fresh
        self._stale = False
        return obs

    def _end(self) -> None:
        self.link.close()
        if self._shared is not None:
            self._shared.close()
            self._shared = None

    def __getattr__(self, name: str) -> Any:
        if name in STAYS:
            raise AttributeError(
                f"`{name}` of a served env stays with the service; `details()` tells what is known of episodes, and "
                f"anysim.make() gives an env that has all of it"
            )
        raise AttributeError(f"'{type(self).__name__}' has no attribute '{name}'")


class _Streams:
    """Of the random streams, what a client may do."""

    def __init__(self, env: RemoteEnv) -> None:
        self._env = env

    def seed(self, seed: int | Sequence[int], env_ids: Array) -> None:
        """Seed envs: an int seeds env i with (seed, i); a sequence gives one seed to each of `env_ids`."""
        self._env.ask("reset", seed=_plain(seed), env_ids=np.asarray(env_ids), pass_over=True)

    @property
    def episode_seed(self) -> Array:
        """(N,) uint64, what the current episode of each env was drawn from."""
        return self._env.info["episode_seed"]


def _plain(value: Any) -> Any:
    """What travels of seeds and overrides: arrays and ranges as lists, mappings with lists."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return [_plain(item) for item in value]
    return value
