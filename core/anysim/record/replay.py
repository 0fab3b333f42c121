"""Replay: a run is rebuilt from its manifest, the recorded actions are applied, and every state is compared."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError, listing
from anysim.math.matrix import blas_kernel
from anysim.record.frame import state_digest, state_rows
from anysim.record.header import EpisodeHeader
from anysim.record.manifest import Manifest
from anysim.record.reader import TrajectoryReader, open_trajectory
from anysim.task.env import TaskEnv


class FieldDrift(NamedTuple):
    """One state array.

    Attributes:
        identical: every bit is the same.
        first_step: the first control step that differs in a bit, or None.
        max_abs: the largest absolute difference, in the array's units; quaternions q and -q do not differ; inf where
            one of two values is not finite.
        max_step: the control step where that is; 0 if nothing differs.
    """

    identical: bool
    first_step: int | None
    max_abs: float
    max_step: int


class Drift(NamedTuple):
    """All state arrays that both have, over the steps that both have."""

    fields: Mapping[str, FieldDrift]
    recorded_steps: int
    replayed_steps: int

    @property
    def identical(self) -> bool:
        """As many steps, and every bit the same."""
        return self.recorded_steps == self.replayed_steps and all(f.identical for f in self.fields.values())

    @property
    def first_step(self) -> int | None:
        """The first control step at which anything differs, or None."""
        steps = [f.first_step for f in self.fields.values() if f.first_step is not None]
        if self.recorded_steps != self.replayed_steps:
            steps.append(min(self.recorded_steps, self.replayed_steps) + 1)
        return min(steps, default=None)

    def __str__(self) -> str:
        if self.identical:
            return f"identical, bit for bit, over {self.recorded_steps} steps"
        steps = f"of {self.recorded_steps} recorded, {self.replayed_steps} replayed"
        lines = [f"differs from step {self.first_step} on ({steps})"]
        for name, field in self.fields.items():
            if not field.identical:
                lines.append(
                    f"  {name}: from step {field.first_step}, at most {field.max_abs:.3g} (at step {field.max_step})"
                )
        return "\n".join(lines)


def compare_states(recorded: Mapping[str, Array], replayed: Mapping[str, Array]) -> Drift:
    """Compare (T, …) arrays by name; row t is the state after control step t + 1.

    Raises:
        RecordError: names or shapes differ, so that the two are not of one world.
    """
    if recorded.keys() != replayed.keys():
        raise RecordError(
            "recorded and replayed states hold different arrays: "
            f"{listing(sorted(recorded))} and {listing(sorted(replayed))}"
        )
    lengths = [_steps(recorded, "recorded"), _steps(replayed, "replayed")]
    common = min(lengths)
    fields: dict[str, FieldDrift] = {}
    for name in sorted(recorded):
        a, b = recorded[name][:common], replayed[name][:common]
        if a.shape != b.shape:
            raise RecordError(
                f"'{name}' was recorded as {a.shape[1:]} and replayed as {b.shape[1:]}; the worlds differ"
            )
        fields[name] = _field(name, np.asarray(a, np.float64), np.asarray(b, np.float64))
    return Drift(fields, *lengths)


def _steps(states: Mapping[str, Array], which: str) -> int:
    lengths = {len(array) for array in states.values()}
    if len(lengths) > 1:
        raise RecordError(f"the {which} arrays have different numbers of steps: {listing(map(str, sorted(lengths)))}")
    return lengths.pop() if lengths else 0


def _field(name: str, a: Array, b: Array) -> FieldDrift:
    rows = len(a)
    bits = (np.ascontiguousarray(a).view(np.uint64) != np.ascontiguousarray(b).view(np.uint64)).reshape(rows, -1)
    differs = np.flatnonzero(bits.any(axis=1)) if bits.size else np.empty(0, dtype=int)
    if not len(differs):
        return FieldDrift(True, None, 0.0, 0)
    if name == "body_pose":
        sign = np.where((a[..., 3:] * b[..., 3:]).sum(axis=-1, keepdims=True) < 0, -1.0, 1.0)
        b = np.concatenate([b[..., :3], b[..., 3:] * sign], axis=-1)
    with np.errstate(invalid="ignore"):
        gap = np.abs(a - b)
    gap = np.where(np.isfinite(gap), gap, np.where(a == b, 0.0, np.inf)).reshape(rows, -1).max(axis=1)
    worst = int(gap.argmax())
    return FieldDrift(False, int(differs[0]) + 1, float(gap[worst]), worst + 1)


@dataclass(frozen=True)
class ReplayResult:
    """How a replay came out.

    Attributes:
        manifest: of the recording.
        engine: what it was replayed on, with version.
        linear_algebra: the BLAS kernel that numpy used meanwhile.
        same_world: the rebuilt world has the recorded hash.
        same_start: the state right after the reset is the recorded one to the bit (true where it was not recorded).
        drift: recorded against replayed states after each step.
        status: how the replayed episode ended; `recorded_status` how the recorded one did.
    """

    manifest: Manifest
    engine: str
    linear_algebra: str
    same_world: bool
    same_start: bool
    drift: Drift
    status: str

    @property
    def recorded_status(self) -> str:
        """How the recorded episode ended."""
        return self.manifest.status

    @property
    def explanation(self) -> str:
        """What rounds differently here than where it was recorded, as a sentence; empty where nothing does."""
        before = {
            "engine": f"{self.manifest.engine} {self.manifest.engine_version}",
            "linear algebra": str(self.manifest.clock.get("linear_algebra", self.linear_algebra)),
        }
        now = {"engine": self.engine, "linear algebra": self.linear_algebra}
        others = [f"the {what} was {before[what]} and is {now[what]}" for what in now if before[what] != now[what]]
        return f"Bits may differ: {'; '.join(others)}." if others else ""

    @property
    def identical(self) -> bool:
        """The same world, the same start, and every state the same to the bit."""
        return self.same_world and self.same_start and self.drift.identical


def rebuild(manifest: Manifest, engine: str | None = None, base: Path | None = None) -> TaskEnv:
    """The env of a recording, alone: one env, whatever their number was.

    `base` is the folder of the recorded file where its world refers to assets by relative paths.
    """
    from anysim.api import make

    spec: dict[str, Any] = dict(manifest.spec) | {"num_envs": 1}
    if engine is not None and engine != manifest.engine:
        spec["engine"] = {"name": engine}
    return make(spec, base=base, curriculum=True)  # where it was followed, the recorded spec says it


def replay(directory: str | Path, engine: str | None = None, base: Path | None = None) -> ReplayResult:
    """Replay a committed trajectory on the engine it was recorded on, or on another.

    With the same engine, version and linear algebra the states are equal to the bit; elsewhere the drift says how far
    not, and `explanation` what is another.

    Raises:
        RecordError: the trajectory is damaged.
        CapabilityError: the other engine cannot run this world.
    """
    reader = open_trajectory(directory)
    with rebuild(reader.manifest, engine, base) as env:
        start, states = _run(env, reader)
        recorded = reader.initial_state
        same_start = not recorded or state_digest(start) == state_digest(recorded)
        return ReplayResult(
            reader.manifest,
            f"{env.engine.name} {env.engine.version}",
            blas_kernel(),
            env.engine.world.hash == reader.manifest.world_hash,
            same_start,
            compare_states(reader.states, states),
            str(env.status[0]),
        )


def begin(env: TaskEnv, manifest: Manifest | EpisodeHeader) -> None:
    """Begin the recorded episode: drawn from its seed, with what was overridden for it."""
    for manager in env.managers:
        manager.recall(0, manifest.drawn)
    env.reset(episode_seeds=[manifest.episode_seed], overrides=manifest.overridden)


def _run(env: TaskEnv, reader: TrajectoryReader) -> tuple[dict[str, Array], dict[str, Array]]:
    """The state (…) after the reset, and the states (T, …) after each step as far as the replayed episode goes."""
    begin(env, reader.manifest)
    fields = tuple(reader.manifest.layout.state)
    own = [name for name in fields if name not in env.sensor_rows(np.arange(1))]

    def now() -> dict[str, Array]:
        rows = state_rows(env.engine.get_state(), 0, own, env.engine.control)
        rows |= {name: sensed[0] for name, sensed in env.sensor_rows(np.arange(1)).items()}
        return {name: np.array(values) for name, values in rows.items()}

    start = now()
    steps: list[dict[str, Array]] = []
    for action in reader.actions:
        if not env.running[0]:
            break
        env.step(action[None])
        steps.append(now())
    return start, {name: np.stack([step[name] for step in steps]) for name in fields}
