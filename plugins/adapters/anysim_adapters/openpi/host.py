"""A policy as openpi's clients ask it: an observation and a prompt in, a chunk of actions out."""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, Self

import numpy as np

from anysim import __version__, registry
from anysim.api import make
from anysim.conventions import Array
from anysim.errors import TaskError, listing
from anysim_evaluation.policy import Judging, make_policy, parse
from anysim_policy.names import named

PROMPT = "prompt"
PROMPT_LETTERS = 10_000
PRIVILEGED = "privileged"


class StandingEnv:
    """The env of a task that is never stepped: policies read its spaces, and the words and steps of those who ask.

    Attributes:
        prompts: what each client says the task is; the task's own words where it says nothing.
        scene: with `elapsed` (N,), how often each client has asked.
    """

    def __init__(self, env: Any) -> None:
        self._env = env
        self.prompts = [""] * env.num_envs
        self.scene = SimpleNamespace(elapsed=np.zeros(env.num_envs, np.int64))

    def instruction(self, env: int) -> str:
        """The task in words, as a client said it."""
        return self.prompts[env] or self._env.instruction(env)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._env, name)


class PolicyHost:
    """A policy of a task, asked for one client after another. It is one thread's own."""

    def __init__(
        self,
        task: Any,
        policy: str,
        *,
        clients: int = 8,
        engine: str | None = None,
        overrides: tuple[str, ...] = (),
        keys: str = "",
    ) -> None:
        """Make the env, for its spaces, and the policy.

        Args:
            task: an installed task by name, a file, or a mapping.
            policy: as `anysim evaluate --policy` names it.
            clients: at once; each has a memory of its own where the policy remembers.
            engine: in place of the task's.
            overrides: of the task, `PATH=VALUE`.
            keys: the clients' names of observations, `THEIRS:OURS` joined by `+`; empty: ours.

        Raises:
            TaskError: there is no such policy, or it needs a simulator and not observations.
        """
        self._env = make(task, engine=engine, num_envs=clients, overrides=list(overrides))
        try:
            self._env.reset(seed=0)
            env = self._env
            self._standing: Any = StandingEnv(env)
            known = [name for name in [*env.observation_sizes, *env.image_shapes] if name != PRIVILEGED]
            self._keys = named(keys, known, env.name, "observation/state") if keys else {name: name for name in known}
            _refuse_seer(policy)
            self._policy = make_policy(self._standing, policy)
        except BaseException:
            self._env.close()
            raise
        self._name = policy
        self.clients = clients

    @property
    def metadata(self) -> dict[str, Any]:
        """What a client is told first: the task, and what observations and actions are."""
        env = self._env
        sizes = {theirs: env.observation_sizes.get(ours) for theirs, ours in self._keys.items()}
        return {
            "task": env.name,
            "policy": self._name,
            "anysim": __version__,
            "control_dt": float(env.engine.world.physics.control_dt),
            "action_dim": int(env.action_dim),
            "actions": [str(label) for label in env.action_spaces.labels],
            "observations": {theirs: int(size) for theirs, size in sizes.items() if size is not None},
            "images": {
                theirs: [int(side) for side in env.image_shapes[ours]]
                for theirs, ours in self._keys.items()
                if ours in env.image_shapes
            },
            PROMPT: env.instruction(0),
        }

    def begin(self, client: int) -> None:
        """Forget what this client was told before it was another one."""
        self._standing.prompts[client], self._standing.scene.elapsed[client] = "", 0
        self._policy.reset(np.array([client]))

    def infer(self, client: int, seen: Mapping[Any, Any]) -> Array:
        """The chunk (K, A) for an observation.

        Raises:
            TaskError: it is not of the form that `metadata` tells, or the policy needs something else.
        """
        obs = {ours: self._checked(theirs, seen[theirs]) for theirs, ours in self._keys.items() if theirs in seen}
        prompt = seen.get(PROMPT, "")
        if not isinstance(prompt, str) or len(prompt) > PROMPT_LETTERS:
            raise TaskError(f"`{PROMPT}` is the task in words, a text of at most {PROMPT_LETTERS:,} letters")
        self._standing.prompts[client] = prompt
        try:
            given = np.asarray(self._policy.act(obs, np.array([client])))
        except (TaskError, KeyError) as error:
            lacking = [theirs for theirs in self._keys if theirs not in seen]
            if not lacking:
                raise
            what = f"no observation {error}" if isinstance(error, KeyError) else str(error)
            raise TaskError(f"{what} (not among what was sent: {listing(lacking)})") from None
        self._standing.scene.elapsed[client] += 1
        dim = self._env.action_dim
        if given.shape[:1] != (1,) or given.ndim not in (2, 3) or given.shape[-1] != dim or not given.size:
            raise TaskError(f"the policy gave {given.shape} for one observation; expected (1, {dim}) or (1, K, {dim})")
        chunk = given.reshape(-1, dim).astype(np.float64)
        if not np.isfinite(chunk).all():
            raise TaskError("the policy gave actions that are no finite numbers")
        return chunk

    def _checked(self, theirs: str, value: Any) -> Array:
        """The observation under a client's name, as a row of its own (1, …)."""
        env, ours = self._env, self._keys[theirs]
        rows = np.asarray(value)
        if ours in env.image_shapes:
            shape = env.image_shapes[ours]
            if rows.shape != shape or rows.dtype != (np.uint8 if len(shape) == 3 else np.float32):
                kind = "uint8" if len(shape) == 3 else "float32"
                raise TaskError(f"'{theirs}' is an image {shape} of {kind}, got {rows.shape} of {rows.dtype}")
            return rows[None]
        size = env.observation_sizes[ours]
        if rows.shape != (size,) or rows.dtype.kind not in "biuf":
            raise TaskError(f"'{theirs}' is ({size},) numbers, got {rows.shape} of {rows.dtype}")
        return rows.astype(np.float64)[None]

    def close(self) -> None:
        """Free the env, and what the policy holds."""
        closed = getattr(self._policy, "close", None)
        if closed is not None:
            closed()
        self._env.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _refuse_seer(policy: str) -> None:
    """Refuse a policy that looks at the simulator, which here stands still."""
    said = parse(policy)
    made = None if said.function else registry.load("env_policies", said.name)
    if isinstance(made, type) and issubclass(made, Judging):
        raise TaskError(
            f"the policy '{policy}' acts by what the simulator knows, and a client sends observations alone; serve one "
            "that acts by these, as FILE.onnx or shipped"
        )
