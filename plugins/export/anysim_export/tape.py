"""The actions of a LeRobot data set, played in envs that begin as its episodes did."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.errors import PluginError, RecordError
from anysim.record.json import load_json
from anysim.task.env import TaskEnv
from anysim_export.envs import env_of
from anysim_export.lerobot.exporter import VERSION
from anysim_export.sheet import ExportSheet, read_sheet


class Tape(NamedTuple):
    """Actions (T, A) float64 of each episode, so many a second, and how these began where the data set says it."""

    directory: Path
    actions: list[Array]
    fps: float
    sheet: ExportSheet | None


class Played(NamedTuple):
    """How an episode of a tape came out, and how it was recorded (empty where that is unknown)."""

    episode: int
    status: str
    recorded: str
    steps: int


def read_tape(directory: Path) -> Tape:
    """The actions of a data set of LeRobot.

    Raises:
        RecordError: it is none of this version, or is damaged.
        PluginError: pyarrow is not installed.
    """
    try:
        import pyarrow.parquet as pq  # pyright: ignore[reportMissingImports]
        from pyarrow.lib import ArrowException  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise PluginError("a tape is read with pyarrow: pip install 'anysim-export[lerobot]'") from error
    if not (directory / "meta" / "info.json").exists():
        raise RecordError(
            f"{directory} is no data set of LeRobot: it has no meta/info.json. A tape is what `anysim export --to "
            "lerobot` writes, or such a data set from elsewhere; a recording is played by `anysim replay`"
        )
    info = load_json(directory / "meta" / "info.json")
    version = info.get("codebase_version") if isinstance(info, dict) else None
    if version != VERSION:
        raise RecordError(
            f"{directory} is of LeRobot's format {version}; expected {VERSION}, which lerobot converts to"
        )
    rows: dict[int, list[tuple[int, Array]]] = {}
    try:
        for path in sorted((directory / "data").glob("chunk-*/file-*.parquet")):
            table = pq.read_table(path, columns=["action", "episode_index", "frame_index"])
            numbers = table["episode_index"].to_numpy(), table["frame_index"].to_numpy()
            for action, i, t in zip(table["action"].to_pylist(), *numbers, strict=True):
                rows.setdefault(int(i), []).append((int(t), np.atleast_1d(np.array(action, dtype=np.float64))))
    except (ArrowException, OSError, KeyError, ValueError) as error:
        raise RecordError(f"{path} cannot be read as frames of LeRobot: {error}") from error
    found = sorted(rows)
    whole = all([t for t, _ in rows[i]] == list(range(len(rows[i]))) for i in found)
    if not found or found != list(range(len(found))) or not whole:
        raise RecordError(f"{directory} lacks episodes or frames: it has {len(found)} episodes; export it anew")
    sheet = read_sheet(directory)
    actions = [np.stack([action for _, action in rows[i]]) for i in found]
    if sheet is not None and [one.steps for one in sheet.episodes] != [len(one) for one in actions]:
        raise RecordError(f"{directory}: anysim.json tells of other episodes than there are; remove it, or export anew")
    try:
        fps = float(info["fps"])
    except (KeyError, TypeError, ValueError):
        raise RecordError(f"{directory}/meta/info.json does not say how many frames a second has (`fps`)") from None
    return Tape(directory, actions, fps, sheet)


def play(tape: Tape, *, engine: str | None = None, task: str | None = None, seed: int = 0) -> Iterator[Played]:
    """Play each episode to its end, alone in an env, and yield how it came out.

    Args:
        engine: in place of the recorded one.
        task: to play in; None: as recorded.
        seed: with a task, that of the first episode; the others follow.

    Raises:
        RecordError: the data set does not say what its episodes began with, and no task is given; or the actions are
            others than the robot's, or for other control steps.
    """
    if task is None and tape.sheet is None:
        raise RecordError(
            f"{tape.directory} does not say how its episodes began (it has no anysim.json); name the task to play in "
            "with --task, which begins them from seeds of its own"
        )
    opened: dict[int, TaskEnv] = {}
    try:
        for i, actions in enumerate(tape.actions):
            begun = None if task is not None or tape.sheet is None else tape.sheet.episodes[i]
            run = -1 if begun is None else begun.spec
            if run not in opened:
                _close(opened)
                opened[run] = _env(tape, run, engine, task)
            env = opened[run]
            if actions.shape[1] != env.action_dim:
                raise RecordError(
                    f"{tape.directory} has actions of {actions.shape[1]} numbers; '{env.name}' takes {env.action_dim}"
                )
            rate = 1.0 / env.engine.world.physics.control_dt
            if abs(tape.fps / rate - 1.0) > 1e-3:
                raise RecordError(
                    f"{tape.directory} has {tape.fps:g} actions a second; '{env.name}' takes {rate:g}. "
                    "Name a task with this rate, or convert the data set: as they are, movements had another speed"
                )
            if begun is None:
                env.reset(episode_seeds=[seed + i])
            else:
                for manager in env.managers:
                    manager.recall(0, begun.drawn)
                env.reset(episode_seeds=[begun.episode_seed], overrides=begun.overridden)
            done = 0
            while done < len(actions) and env.running[0]:
                env.step(actions[done][None])
                done += 1
            yield Played(i, str(env.status[0]), "" if begun is None else begun.status, done)
    finally:
        _close(opened)


def _env(tape: Tape, run: int, engine: str | None, task: str | None) -> TaskEnv:
    """An env of its own for the episodes of a run; of `task`, where that is given."""
    if task is not None:
        from anysim.api import make

        return make(task, engine=engine, num_envs=1)
    assert tape.sheet is not None
    return env_of(tape.sheet.specs[run], engine)


def _close(opened: dict[int, TaskEnv]) -> None:
    for env in opened.values():
        env.close()
    opened.clear()
