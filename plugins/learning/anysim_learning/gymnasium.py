"""Gymnasium views: one env as `gymnasium.Env`, many as `gymnasium.vector.VectorEnv` in all three autoreset modes."""

from typing import Any, Literal

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.task.contract import Obs, Status
from anysim.task.env import TaskEnv

PRIVILEGED = "privileged"
"""The group of observations that only a simulator knows; a view shows it on request."""


def observation_space(env: TaskEnv, privileged: bool = False) -> gym.spaces.Dict:
    """A Dict with a float32 Box for each observation group that is shown, and one for each observed image."""
    spaces: dict[str, gym.Space[Any]] = {
        group: gym.spaces.Box(-np.inf, np.inf, (size,), np.float32)
        for group, size in env.observation_sizes.items()
        if privileged or group != PRIVILEGED
    }
    spaces |= {name: _image_space(name, shape) for name, shape in env.image_shapes.items()}
    return gym.spaces.Dict(spaces)


def _image_space(name: str, shape: tuple[int, ...]) -> gym.spaces.Box:
    """The range of an image: colours, metres, or entity ids."""
    if name.endswith("/depth"):
        return gym.spaces.Box(0.0, np.inf, shape, np.float32)
    if name.endswith("/segmentation"):
        return gym.spaces.Box(0, np.iinfo(np.int32).max, shape, np.int32)
    return gym.spaces.Box(0, 255, shape, np.uint8)


ActionForm = Literal["flat", "named"]
"""One vector for all robots, or an array for each `robot.channel`."""


def action_space(env: TaskEnv, form: ActionForm = "flat") -> gym.spaces.Space[Any]:
    """A float32 Box with the bounds of the robots' channels, or a Dict with one for each channel.

    Raises:
        TaskError: there is no such form.
    """
    if form not in ("flat", "named"):
        raise TaskError(f"an action space is 'flat' or 'named', got '{form}'")
    if form == "flat":
        return _box(*env.action_bounds)
    return gym.spaces.Dict({name: _box(space.low, space.high) for name, space in env.action_spaces.items()})


def _box(low: Array, high: Array) -> gym.spaces.Box:
    return gym.spaces.Box(low.astype(np.float32), high.astype(np.float32), dtype=np.float32)


def _batch(action: Any, form: ActionForm) -> Any:
    """The action of one env as that of a batch of one."""
    if form == "flat":
        return np.asarray(action)[None]
    return {name: np.asarray(part)[None] for name, part in action.items()}


def _metadata(env: TaskEnv) -> dict[str, Any]:
    return {"render_modes": ["rgb_array"], "render_fps": round(1 / env.engine.world.physics.control_dt)}


def _single_info(info: dict[str, Array], status: Array, row: int) -> dict[str, Any]:
    return {key: value[row].item() for key, value in info.items()} | {"status": str(status[row])}


def _with_masks(values: dict[str, Array], present: Array) -> dict[str, Any]:
    """Gymnasium's vector info: each key with a `_key` mask of the envs that have it."""
    return {k: v for key, value in values.items() for k, v in ((key, value), (f"_{key}", present.copy()))}


class GymEnv(gym.Env[dict[str, Array], Any]):
    """One env. `info` holds `status`, `is_success`, `fault`, `elapsed_steps` and `episode_seed`."""

    def __init__(
        self, env: TaskEnv, render_mode: str | None = None, action: ActionForm = "flat", privileged: bool = False
    ) -> None:
        if env.num_envs != 1:
            raise TaskError(f"GymEnv views an env with num_envs=1, this one has {env.num_envs}; use GymVectorEnv")
        self.env = env
        self.metadata = _metadata(env)
        self.render_mode = render_mode
        shown = observation_space(env, privileged)
        self.observation_space: gym.spaces.Space[Any] = shown
        self._shown = tuple(shown)
        self.action_space: gym.spaces.Space[Any] = action_space(env, action)
        self._form: ActionForm = action

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Array], dict[str, Any]]:
        """Start an episode; `options={"episode_seed": s}` starts exactly that one."""
        super().reset(seed=seed)
        chosen = (options or {}).get("episode_seed")
        obs, info = self.env.reset(
            seed=None if seed is None else [seed], episode_seeds=None if chosen is None else [int(chosen)]
        )
        return self._first(obs), _single_info(info, self.env.status, 0)

    def _first(self, obs: Obs) -> dict[str, Array]:
        return {name: obs[name][0] for name in self._shown}

    def step(self, action: Any) -> tuple[dict[str, Array], float, bool, bool, dict[str, Any]]:
        """One control step."""
        result = self.env.step(_batch(action, self._form))
        return (
            self._first(result.obs),
            float(result.reward[0]),
            bool(result.terminated[0]),
            bool(result.truncated[0]),
            _single_info(result.info, result.status, 0),
        )

    def render(self) -> Array | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """An image (H, W, 3) uint8 if the render mode is `rgb_array`."""
        return self.env.render()[0] if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        self.env.close()


class GymVectorEnv(VectorEnv[dict[str, Array], Any, Any]):
    """Many envs, the same to the bit as gymnasium's `SyncVectorEnv` of single views, without its loop.

    SAME_STEP resets ended envs within the step and gives their last observation and info as `final_obs` and
    `final_info`; NEXT_STEP resets them in the next step; DISABLED leaves it to
    `reset(options={"reset_mask": mask})`.
    """

    def __init__(
        self,
        env: TaskEnv,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        action: ActionForm = "flat",
        privileged: bool = False,
    ) -> None:
        self.env = env
        self.num_envs = env.num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = _metadata(env) | {"autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self.single_observation_space = observation_space(env, privileged)
        self._shown = tuple(self.single_observation_space)
        self.single_action_space = action_space(env, action)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._pending = np.zeros(self.num_envs, dtype=bool)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Array], dict[str, Any]]:
        """Reset all envs, or those of `options["reset_mask"]`; an int seeds env i with seed + i."""
        mask = (options or {}).get("reset_mask")
        mask = np.ones(self.num_envs, dtype=bool) if mask is None else np.asarray(mask)
        if isinstance(seed, int | np.integer):
            self._np_random, self._np_random_seed = seeding.np_random(int(seed))
            seed = [int(seed) + i for i in range(self.num_envs)]
        if seed is not None:
            if len(seed) != self.num_envs:
                raise TaskError(f"{self.num_envs} envs need as many seeds, got {len(seed)}")
            seeded = np.array([s is not None for s in seed]) & mask
            self.env.streams.seed(
                [int(s) for s, on in zip(seed, seeded, strict=True) if s is not None and on], np.flatnonzero(seeded)
            )
        _, info = self.env.reset(mask=mask)
        self._pending[mask] = False
        return self._obs(), _with_masks(self._spread(info, mask), mask)

    def step(self, actions: Any) -> tuple[dict[str, Array], Array, Array, Array, dict[str, Any]]:
        """One control step of all envs; what becomes of ended ones is the autoreset mode's."""
        fresh = self._pending.copy()
        if self.autoreset_mode is AutoresetMode.DISABLED:
            if fresh.any():
                raise TaskError(
                    f"envs {np.flatnonzero(fresh).tolist()} have ended; call reset(options={{'reset_mask': mask}})"
                )
        elif fresh.any():
            self.env.reset(mask=fresh)
        stepped = ~fresh
        if stepped.any():
            result = self.env.step(actions, None if stepped.all() else stepped)
            reward, status, info = result.reward.astype(np.float64), result.status, result.info
        else:
            reward, status, info = np.zeros(self.num_envs), self.env.status, self.env.info
        reward[fresh] = 0.0
        terminated = stepped & ((status == Status.SUCCESS) | (status == Status.FAILED))
        truncated = stepped & (status == Status.TRUNCATED)
        done = terminated | truncated
        everyone = np.ones(self.num_envs, dtype=bool)
        extra: dict[str, Any] = {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP and done.any():
            extra = self._final(info, status, done)
            self.env.reset(mask=done)
            info, status = self.env.info, self.env.status
        else:
            self._pending = done
        infos = _with_masks(info | {"status": status.astype(object)}, everyone)
        return self._obs(), reward, terminated, truncated, infos | extra

    def _final(self, info: dict[str, Array], status: Array, done: Array) -> dict[str, Any]:
        obs = self._obs()
        final = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(done):
            final[i] = {g: rows[i] for g, rows in obs.items()}
        kept: dict[str, Array] = {}
        for key, value in (info | {"status": status.astype(object)}).items():
            blank = np.full(self.num_envs, None, dtype=object) if value.dtype == object else np.zeros_like(value)
            blank[done] = value[done]
            kept[key] = blank
        return {
            "final_obs": final,
            "_final_obs": done.copy(),
            "final_info": _with_masks(kept, done),
            "_final_info": done.copy(),
        }

    def _obs(self) -> Obs:
        obs = self.env.obs
        return {name: obs[name] for name in self._shown}

    def _spread(self, info: dict[str, Array], mask: Array) -> dict[str, Array]:
        spread: dict[str, Array] = {}
        for key, rows in info.items():
            full = np.zeros((self.num_envs, *rows.shape[1:]), rows.dtype)
            full[mask] = rows
            spread[key] = full
        words = np.full(self.num_envs, None, dtype=object)
        words[mask] = self.env.status[mask]
        return spread | {"status": words}

    def render(self) -> tuple[Array, ...] | None:
        """One image (H, W, 3) uint8 for each env if the render mode is `rgb_array`."""
        return tuple(self.env.render()) if self.render_mode == "rgb_array" else None

    def close_extras(self, **kwargs: Any) -> None:
        self.env.close()
