"""The collector: one clock, many timelines. Each env runs its own episodes; what succeeds is kept.

Env i runs episodes 0, 1, 2… of its own stream, as many as its share; so which episodes are run, and how they come out,
does not depend on how fast the others are or how many there are.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from anysim.conventions import Array
from anysim.record.frame import Frame, state_rows
from anysim.record.header import EpisodeHeader, RunHeader, camera_info, state_layout
from anysim.record.provenance import package_versions
from anysim.record.recorder import Recorder
from anysim.record.writer import writer_factory
from anysim.task.contract import Status
from anysim.task.env import TaskEnv

STATE_FIELDS = ("joint_pos", "joint_vel", "body_pose", "body_twist", "control_position")
"""What is recorded of the state in each step."""


class Policy(Protocol):
    """What drives the envs: `anysim.skills.runner.SkillPolicy`, or anything with the same methods."""

    name: str

    def begin(self, env_ids: Array) -> None:
        """These envs have just been reset."""
        ...

    def act(self, env_ids: Array) -> Array:
        """Actions (N, A); rows other than `env_ids` are ignored."""
        ...

    def gave_up(self, env_ids: Array) -> Array:
        """(n,) bool: it is of no use to go on in these envs."""
        ...

    def describe(self, env: int) -> dict[str, Any]:
        """Plain data about what an env is doing."""
        ...


@dataclass(frozen=True)
class EpisodeResult:
    """How an episode came out. `path` is its trajectory if one was kept; `resumed` says it was there already."""

    env: int
    episode: int
    episode_seed: int
    status: str
    steps: int
    total_reward: float
    outcome: dict[str, Any]
    path: Path | None = None
    resumed: bool = False

    @property
    def success(self) -> bool:
        """Whether the task was solved."""
        return self.status == Status.SUCCESS


def run_header(env: TaskEnv, seed: int) -> RunHeader:
    """What all trajectories of a run of this env have in common."""
    action = list(env.action_spaces.labels)
    example = {group: np.zeros(size, np.float32) for group, size in env.observation_sizes.items()}
    world = env.engine.world
    return RunHeader(
        task=env.name,
        seed=seed,
        engine=env.engine.name,
        engine_version=env.engine.version,
        world_hash=world.hash,
        control_dt=world.physics.control_dt,
        layout=state_layout(world, STATE_FIELDS, action, example),
        spec=env.spec.to_dict(),
        packages=package_versions(),
    )


class Collector:
    """Runs episodes and records them. Use it once: `for result in collector.run(): ...`."""

    def __init__(self, env: TaskEnv, policy: Policy, out: Path, episodes: int, seed: int) -> None:
        """Run `episodes` in all, shared out as evenly as can be: env i runs one of every N."""
        self.env, self.policy, self.seed = env, policy, seed
        record = env.spec.record
        self.recorder = Recorder(out, writer_factory(record.writer, record.options), run_header(env, seed))
        self._capture = env.capture
        self._share = np.array([len(range(i, episodes, env.num_envs)) for i in range(env.num_envs)])
        self._episode = np.full(env.num_envs, -1)
        self._total = np.zeros(env.num_envs)

    def run(self) -> Iterator[EpisodeResult]:
        """Run all episodes; yields each as it ends, and first those that were committed by an earlier run."""
        env = self.env
        try:
            env.streams.seed(self.seed, np.arange(env.num_envs))
            yield from self._start(np.arange(env.num_envs))
            while (active := env.running).any():
                ids = np.flatnonzero(active)
                result = env.step(self.policy.act(ids), None if active.all() else active)
                self._append(ids, result.reward, result.status)
                over = ids[(result.status[ids] != Status.RUNNING) | self.policy.gave_up(ids)]
                for i in over:
                    yield self._finish(int(i), str(result.status[i]))
                yield from self._start(over)
        finally:
            self.recorder.close()

    # ------------------------------------------------------------------ the beginning and end of an episode

    def _start(self, ids: Array) -> Iterator[EpisodeResult]:
        """Begin the next episode of these envs, passing over what is committed already."""
        committed = self.recorder.committed()
        begin = np.zeros(self.env.num_envs, dtype=bool)
        for i in map(int, ids):
            self._episode[i] += 1
            while (i, int(self._episode[i])) in committed and self._episode[i] < self._share[i]:
                self.env.streams.skip(i, 1)
                yield self._resumed(i, int(self._episode[i]))
                self._episode[i] += 1
            begin[i] = self._episode[i] < self._share[i]
        self.env.retire(np.setdiff1d(ids, np.flatnonzero(begin)))
        if not begin.any():
            return
        self.env.reset(mask=begin)
        fresh = np.flatnonzero(begin)
        self.policy.begin(fresh)
        self._total[fresh] = 0.0
        for i in map(int, fresh):
            self.recorder.start(self._header(i))
        self._append(fresh, None, self.env.status)

    def _header(self, i: int) -> EpisodeHeader:
        env = self.env
        assert env.spec.task is not None
        cameras = {}
        for name in env.spec.record.cameras:
            number = env.engine.index.camera(name)
            camera = env.engine.world.cameras[number]
            pose, fov = env.engine.camera_mounts(name, [i])[0], float(env.engine.camera_fov(name, [i])[0])
            cameras[name] = camera_info(env.engine.world, camera, self._capture.every, pose, fov)
        return EpisodeHeader(
            env=i,
            episode=int(self._episode[i]),
            episode_seed=int(env.streams.episode_seed[i]),
            drawn=env.streams.draws[i],
            overridden=env.streams.overridden[i],
            instruction=env.spec.task.description,
            cameras=cameras,
        )

    def _resumed(self, env: int, episode: int) -> EpisodeResult:
        from anysim.record.manifest import read_manifest
        from anysim.record.names import EPISODES, trajectory_name

        path = self.recorder.out / EPISODES / trajectory_name(env, episode)
        m = read_manifest(path)
        outcome = dict(m.outcome)
        reward = float(outcome.pop("total_reward", 0.0))
        return EpisodeResult(env, episode, m.episode_seed, m.status, m.steps, reward, outcome, path, resumed=True)

    def _finish(self, i: int, status: str) -> EpisodeResult:
        env = self.env
        steps, total = int(env.scene.elapsed[i]), float(self._total[i])
        outcome = self.policy.describe(i)
        if status == Status.RUNNING:  # the policy gave up
            status = str(Status.FAILED)
        keep = env.spec.record.keep == "all" or status == Status.SUCCESS
        path = None
        if keep and not env.info["fault"][i]:
            path = self.recorder.commit(i, status, outcome | {"total_reward": total})
        else:
            self.recorder.discard(i)
        seed = int(env.streams.episode_seed[i])
        return EpisodeResult(i, int(self._episode[i]), seed, status, steps, total, outcome, path)

    # ------------------------------------------------------------------ frames

    def _append(self, ids: Array, reward: Array | None, status: Array) -> None:
        """Record one frame of each env, with images of the cameras that are due. A faulted env has no frame."""
        env = self.env
        state, control, obs = env.engine.get_state(), env.engine.control, env.obs
        healthy = ids[~env.info["fault"][ids]]
        images = self._images(healthy)
        for i in map(int, healthy):
            step = int(env.scene.elapsed[i])
            gained = 0.0 if reward is None else float(reward[i])
            self._total[i] += gained
            self.recorder.append(
                i,
                Frame(
                    step=step,
                    time=float(state.time[i]),
                    action=None if step == 0 else env.scene.last_action[i],
                    state=state_rows(state, i, STATE_FIELDS, control),
                    reward=gained,
                    status=str(status[i]),
                    obs={group: rows[i] for group, rows in obs.items()},
                    annotations=self.policy.describe(i),
                    language=env.spec.task.description if env.spec.task else "",
                    images=images.get(i, {}),
                ),
            )

    def _images(self, ids: Array) -> dict[int, dict[str, Array]]:
        due = self._capture.due(ids)
        images: dict[int, dict[str, Array]] = {int(i): {} for i in due}
        if len(due):
            for camera in self.env.spec.record.cameras:
                pictures = self._capture.image(camera, due)
                for row, i in enumerate(map(int, due)):
                    images[i][camera] = pictures[row]
        return images
