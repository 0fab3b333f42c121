"""A session: episodes of one env, driven by a device, recorded as `anysim run` records them."""

import time
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, Self

import numpy as np

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.record.commit import disk_trouble
from anysim.record.film import camera_of, capture_of, draw_recorded, film_mode
from anysim.record.frame import RecordedFrame, state_rows
from anysim.record.header import EpisodeHeader
from anysim.record.incoming import claim
from anysim.record.manifest import read_manifest
from anysim.record.names import EPISODES, trajectory_name
from anysim.record.streams import make_sources
from anysim.record.writer import make_writer
from anysim.task.bindings import bind_term
from anysim.task.contract import Status
from anysim.task.env import TaskEnv
from anysim_recording.collector import STATE_FIELDS, EpisodeResult, run_header
from anysim_recording.recorder import Recorder
from anysim_teleop.device import Button, DeviceInput, InputDevice, Job, Moment
from anysim_teleop.drive import Drives

DISCARDED = "discarded"
"""The status of an episode that the device gave up, in results; it is in no record."""
SHOWN_EVERY = 0.1
"""[s] of wall time between two pictures."""
_ENV = np.zeros(1, dtype=int)


class Setup(NamedTuple):
    """What a session is told beside the task.

    Attributes:
        device: the device's name, for the record.
        robot: the one that is driven; None for all arms.
        speed: the largest speed of the tool [m/s].
        turn: its largest rate [rad/s].
        camera: whose picture is shown; None for the first of the world.
        solver: of the inverse kinematics.
    """

    device: str
    robot: str | None = None
    speed: float = 0.2
    turn: float = 1.0
    camera: str | None = None
    solver: str = "numba_ik"


class Session:
    """Runs and records episodes. Use it once, within `with`: `for result in session.run(): ...`.

    An episode that succeeds is kept, with `record.keep: all` also one that ends otherwise. What is reset, discarded or
    broken off leaves nothing; whatever ends the session, trajectories on the disk are whole.
    """

    def __init__(self, env: TaskEnv, device: InputDevice, out: Path, episodes: int, seed: int, setup: Setup) -> None:
        """Join the run in `out`, or begin it.

        Args:
            env: with one env.
            device: drives it; opened here, closed with the session.
            out: directory of the run.
            episodes: how many, counted from 0; those that are in `out` are passed over.
            seed: of the env's episodes.
            setup: the rest.

        Raises:
            TaskError: the env has several envs, or no arm that can be driven.
            RecordError: `out` holds another run, or cannot be written.
        """
        if env.num_envs != 1:
            raise TaskError(f"a device drives one env, and there are {env.num_envs}; make the task with num_envs=1")
        self.env, self.device, self.episodes, self.seed, self.setup = env, device, episodes, seed, setup
        self.drives = Drives(env, setup.robot, setup.solver)
        task, record = env.spec.task, env.spec.record
        assert task is not None
        self._instruction, self._keep = task.description, record.keep
        self._film = film_mode(env.spec)
        self._success = {
            name: bind_term("predicate", t, env.scene, f"task.success.{name}", env.bindings)
            for name, t in task.success.items()
        }
        self._dt = env.engine.world.physics.control_dt
        self._camera = _shown_camera(env, setup.camera) if device.shows_pictures else None
        self._total = self._reward = 0.0
        self._due = self._pictured = 0.0
        self.quit = False
        """Whether the device has ended the session."""
        writer = make_writer(record.writer, record.options)
        try:
            self._lock = claim(out)
        except OSError as error:
            raise disk_trouble(f"cannot record into {out}", error, out) from error
        try:
            header, sources = run_header(env, seed), make_sources(env)
            self.recorder = Recorder(out, writer, header, horizon=task.horizon, sources=sources)
            tools = tuple(arm.name for arm in self.drives.arms)
            job = Job(env.name, task.description, env.engine.name, tools, self._dt, setup.speed, setup.turn)
            device.open(job)
        except BaseException:
            self.close()
            raise

    def run(self) -> Iterator[EpisodeResult]:
        """Run the episodes in order; yields each when it is on the disk, or has left nothing."""
        self.env.streams.seed(self.seed, _ENV)
        for number in range(self.episodes):
            if self.recorder.is_committed(0, number):
                self.env.streams.skip(0, 1)
                yield self._resumed(number)
                continue
            result = self._episode(number)
            if result is None:
                self.quit = True
                return
            self.device.tell(told(result))
            yield result

    def close(self) -> None:
        """Close the device and the recorder; what is unfinished is discarded. Further calls do nothing."""
        try:
            self.device.close()
        finally:
            try:
                if hasattr(self, "recorder"):
                    self.recorder.close()
            finally:
                self._lock.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ------------------------------------------------------------------ one episode

    def _episode(self, number: int) -> EpisodeResult | None:
        """Play an episode, from its beginning again as often as it is reset; None where the device quits."""
        env, resets = self.env, 0
        env.reset()
        seed = int(env.streams.episode_seed[0])
        while True:
            self._begin(number)
            ended = self._play(number)
            status = str(env.status[0])
            if ended is Button.RECORD and status == Status.RUNNING:
                status = str(Status.SUCCESS if env.info["is_success"][0] else Status.TRUNCATED)
            if ended is Button.RESET:
                resets += 1
                env.retire(_ENV)
                self.recorder.discard(0)
                env.reset(episode_seeds=[seed])
                continue
            env.retire(_ENV)
            if ended is Button.QUIT:
                self.recorder.discard(0)
                return None
            return self._finish(number, DISCARDED if ended is Button.DISCARD else status, resets)

    def _begin(self, number: int) -> None:
        env, film = self.env, None
        self._total = self._reward = 0.0
        self.drives.begin()
        self.device.begin()
        if self._film == "success":
            film = partial(draw_recorded, env, 0, int(env.engine.appearance_changes[0]))
        header = EpisodeHeader(
            env=0,
            episode=number,
            episode_seed=int(env.streams.episode_seed[0]),
            drawn=env.streams.draws[0],
            overridden=env.streams.overridden[0],
            instruction=self._instruction,
            cameras={name: camera_of(env, 0, name) for name in env.spec.record.cameras},
        )
        self.recorder.start(header, film)
        self._append()

    def _play(self, number: int) -> Button | None:
        """Step until the episode ends by itself (None), or a button ends it."""
        waiting = self.device.live
        self._due = time.monotonic()
        while self.env.running[0]:
            wanted = self.device.read(self._moment(number, waiting))
            for button in wanted.buttons:
                if button is Button.SWITCH:
                    self.drives.switch()
                elif button is not Button.RECORD or not waiting:
                    return button
            waiting = waiting and wanted.idle
            if not waiting:
                self._step(wanted)
            if self.device.live:
                self._keep_time()
        return None

    def _step(self, wanted: DeviceInput) -> None:
        result = self.env.step(self.drives.act(wanted, self.setup.speed, self.setup.turn))
        self._reward = float(result.reward[0])
        if not self.env.info["fault"][0]:
            self._total += self._reward
            self._append()

    def _finish(self, number: int, status: str, resets: int) -> EpisodeResult:
        env = self.env
        faulted = bool(env.info["fault"][0])
        steps, outcome = int(env.scene.elapsed[0]), self._source() | {"resets": resets}
        keep = status != DISCARDED and (self._keep == "all" or status == Status.SUCCESS) and not faulted and steps > 0
        path: Path | None = None
        if keep:
            path = self.recorder.commit(0, status, outcome | {"total_reward": self._total}).wait()
        else:
            self.recorder.discard(0)
        fault = env.engine.fault_reason(0) if faulted else ""
        seed = int(env.streams.episode_seed[0])
        return EpisodeResult(0, number, seed, status, steps, self._total, outcome, path, fault=fault)

    def _resumed(self, number: int) -> EpisodeResult:
        path = self.recorder.out / EPISODES / trajectory_name(0, number)
        m = read_manifest(path)
        total = float(m.outcome.get("total_reward", 0.0))
        return EpisodeResult(0, number, m.episode_seed, m.status, m.steps, total, m.outcome, path, resumed=True)

    # ------------------------------------------------------------------ what is recorded and shown

    def _source(self) -> dict[str, Any]:
        """The devices and what each drives, for the record."""
        setup, arm = self.setup, self.drives.active
        return {
            "source": "teleop",
            "device": setup.device,
            "tool": arm.name,
            "closed": arm.closed,
            "speed": setup.speed,
            "turn": setup.turn,
        }

    def _append(self) -> None:
        env, step = self.env, int(self.env.scene.elapsed[0])
        images: dict[str, Array] = {}
        capture = capture_of(env)
        if self._film == "live" and len(capture.due(_ENV)):
            images = {camera: capture.picture(camera, _ENV)[0] for camera in env.spec.record.cameras}
        state = env.engine.get_state()
        self.recorder.append(
            0,
            RecordedFrame(
                step=step,
                time=float(state.time[0]),
                action=env.scene.last_action[0] if step else None,
                state=state_rows(state, 0, STATE_FIELDS, env.engine.control),
                reward=self._reward if step else 0.0,
                status=str(env.status[0]),
                obs={group: rows[0] for group, rows in env.obs.items() if not group.startswith("images/")},
                annotations=self._source(),
                language=self._instruction,
                images=images,
            ),
        )

    def _moment(self, number: int, waiting: bool) -> Moment:
        arm, picture = self.drives.active, None
        if self._camera is not None and time.monotonic() - self._pictured >= SHOWN_EVERY:
            picture = capture_of(self.env).picture(self._camera, _ENV)[0]
            self._pictured = time.monotonic()
        elapsed = int(self.env.scene.elapsed[0])
        return Moment(
            number,
            self.episodes,
            waiting,
            elapsed * self._dt,
            self._judged(),
            self._reward,
            self._total,
            arm.name,
            arm.closed,
            picture,
        )

    def _judged(self) -> Mapping[str, bool]:
        """What each term of success says; nothing where no page looks."""
        if not self.device.live:
            return MappingProxyType({})
        return {name: bool(term()[0]) for name, term in self._success.items()}

    def _keep_time(self) -> None:
        """Wait until the control step is over in real time; what is late is not made up for."""
        now = time.monotonic()
        self._due = max(self._due + self._dt, now)
        time.sleep(max(0.0, self._due - now))


def told(result: EpisodeResult) -> str:
    """An episode in one line."""
    kept = f" -> {result.path}" if result.path else ", not kept"
    why = f" ({result.fault})" if result.fault else ""
    return f"episode {result.episode}: {result.status} in {result.steps} steps{why}{kept}"


def _shown_camera(env: TaskEnv, name: str | None) -> str | None:
    """The camera whose picture is shown; None where the world has none."""
    seeing = [camera.name for camera in env.engine.world.cameras if "rgb" in camera.channels]
    if name is not None and name not in seeing:
        raise TaskError(
            f"'{env.name}' has no camera '{name}' that gives colours (cameras: {', '.join(seeing) or 'none'}); "
            "name one of them with --camera"
        )
    return name or (seeing[0] if seeing else None)
