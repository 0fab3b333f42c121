"""Replay: rebuild a run from its manifest, apply the recorded actions, and compare every state."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.record.drift import Drift, compare_states
from anysim.record.frame import state_digest, state_rows
from anysim.record.manifest import Manifest
from anysim.record.reader import TrajectoryReader, open_trajectory
from anysim.task.env import TaskEnv


@dataclass(frozen=True)
class ReplayResult:
    """How a replay came out.

    Attributes:
        manifest: of the recording.
        engine: what it was replayed on, with version.
        same_world: the rebuilt world has the recorded hash.
        same_start: the state right after the reset is the recorded one to the bit (true where it was not recorded).
        drift: recorded against replayed states after each step.
        status: how the replayed episode ended; `recorded_status` how the recorded one did.
    """

    manifest: Manifest
    engine: str
    same_world: bool
    same_start: bool
    drift: Drift
    status: str

    @property
    def recorded_status(self) -> str:
        """How the recorded episode ended."""
        return self.manifest.status

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
    return make(spec, base=base)


def replay(directory: str | Path, engine: str | None = None, base: Path | None = None) -> ReplayResult:
    """Replay a committed trajectory on the engine it was recorded on, or on another.

    On the same engine, version and machine the states are equal to the bit; elsewhere the drift says how far not.

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
            env.engine.world.hash == reader.manifest.world_hash,
            same_start,
            compare_states(reader.states, states),
            str(env.status[0]),
        )


def begin(env: TaskEnv, manifest: Manifest) -> None:
    """Begin the recorded episode: drawn from its seed, with what was overridden for it."""
    for manager in env.managers:
        manager.recall(0, manifest.drawn)
    env.reset(episode_seeds=[manifest.episode_seed], overrides=manifest.overridden)


def _run(env: TaskEnv, reader: TrajectoryReader) -> tuple[dict[str, Array], dict[str, Array]]:
    """The state (…) after the reset, and the states (T, …) after each step as far as the replayed episode goes."""
    fields = tuple(reader.manifest.layout.state)
    begin(env, reader.manifest)

    def now() -> dict[str, Array]:
        rows = state_rows(env.engine.get_state(), 0, fields, env.engine.control)
        return {name: np.array(values) for name, values in rows.items()}

    start = now()
    steps: list[dict[str, Array]] = []
    for action in reader.actions:
        if not env.running[0]:
            break
        env.step(action[None])
        steps.append(now())
    return start, {name: np.stack([step[name] for step in steps]) for name in fields}
