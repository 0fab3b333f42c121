"""Replay: rebuild a run from its manifest, apply the recorded actions, and compare every state."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.record.compare import Drift, compare_states
from anysim.record.frame import state_rows
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
        drift: recorded against replayed states, with the initial state as an extra first row where it was recorded.
        status: how the replayed episode ended; `recorded_status` how the recorded one did.
    """

    manifest: Manifest
    engine: str
    same_world: bool
    drift: Drift
    status: str

    @property
    def recorded_status(self) -> str:
        """How the recorded episode ended."""
        return self.manifest.status

    @property
    def identical(self) -> bool:
        """The same world, and every state the same to the bit."""
        return self.same_world and self.drift.identical


def rebuild(manifest: Manifest, engine: str | None = None) -> TaskEnv:
    """The env of a recording, alone: one env, whatever their number was."""
    from anysim.api import make

    spec: dict[str, Any] = dict(manifest.spec) | {"num_envs": 1}
    if engine is not None and engine != manifest.engine:
        spec["engine"] = {"name": engine}
    return make(spec)


def replay(directory: str | Path, engine: str | None = None) -> ReplayResult:
    """Replay a committed trajectory on the engine it was recorded on, or on another.

    On the same engine, version and machine the states are equal to the bit; elsewhere the drift says how far not.

    Raises:
        RecordError: the trajectory is damaged.
        CapabilityError: the other engine cannot run this world.
    """
    reader = open_trajectory(directory)
    with rebuild(reader.manifest, engine) as env:
        states, status = _run(env, reader)
        recorded = {k: _with_first(reader.initial_state.get(k), rows) for k, rows in reader.states.items()}
        return ReplayResult(
            reader.manifest, f"{env.engine.name} {env.engine.version}",
            env.engine.world.hash == reader.manifest.world_hash, compare_states(recorded, states), status,
        )  # fmt: skip


def _with_first(first: Array | None, rows: Array) -> Array:
    return rows if first is None else np.concatenate([first[None], rows])


def _run(env: TaskEnv, reader: TrajectoryReader) -> tuple[dict[str, Array], str]:
    """States (T, …) of the replayed episode, as far as it goes, and its status at the end."""
    fields = tuple(reader.manifest.layout.state)
    env.reset(episode_seeds=[reader.manifest.episode_seed])
    rows: list[dict[str, Array]] = []

    def keep() -> None:
        found = state_rows(env.engine.get_state(), 0, fields, env.engine.control)
        rows.append({name: np.array(values) for name, values in found.items()})

    if reader.manifest.has_initial_frame:
        keep()
    for action in reader.actions:
        if not env.running[0]:
            break
        env.step(action[None])
        keep()
    return {name: np.stack([row[name] for row in rows]) for name in fields}, str(env.status[0])
