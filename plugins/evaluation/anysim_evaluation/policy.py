"""Policies of whole envs: the contract, and how one is named on the command line.

A policy is an entry point of the group `anysim.env_policies`: a class that is made of an env and keyword-only
parameters. Nothing about an episode may depend on which env it runs in: draws come from `env.streams.generator`.
"""

import importlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import yaml

from anysim import registry
from anysim.conventions import Array
from anysim.errors import TaskError
from anysim.plugin_parameters import checked, options_model, parameters
from anysim.task.contract import Obs
from anysim.task.env import TaskEnv

MODELS = (".onnx", ".pt", ".jit")
"""How the files of models end."""
FILE = "file"
"""The policy that runs them."""


class Policy(Protocol):
    """What `anysim evaluate` drives envs with.

    One that depends on more than its name and options, as on a file, says on what in a text `version`.
    """

    def reset(self, env_ids: Array) -> None:
        """These envs have just begun an episode."""
        ...

    def act(self, obs: Obs, env_ids: Array) -> Array:
        """Actions (n, A) for the rows of `obs`, which are those of `env_ids`; or chunks (n, K, A).

        A chunk is carried out step by step; the policy is asked again for an env once its chunk is used up.
        """
        ...


@runtime_checkable
class Judging(Protocol):
    """A policy that also knows when an episode need not go on, as the expert does."""

    def gave_up(self, env_ids: Array) -> Array:
        """(n,) bool: it is of no use to go on in these envs."""
        ...

    def solved(self, env_ids: Array) -> Array:
        """(n,) bool: all is done and the task's success holds, though the episode may go on."""
        ...

    def failure(self, env: int) -> str:
        """Why an env's episode failed, as one word; empty where the policy cannot say."""
        ...


class Effort(NamedTuple):
    """What an episode took a policy.

    Attributes:
        retries: how often it tried again.
        done: commands of the task that are done, None where it has none.
        required: those that there are.
    """

    retries: int
    done: int | None
    required: int | None


@runtime_checkable
class Striving(Protocol):
    """A policy that counts what an episode took, as the expert does."""

    def effort(self, env: int, success: bool) -> Effort:
        """Of the episode of an env, which has just ended."""
        ...


class PolicyName(NamedTuple):
    """`NAME`, `NAME:KEY=VALUE,KEY=VALUE`, `MODULE:FUNCTION`, or a file.

    The first of the options may be a value alone: an address (`NAME:SCHEME://ADDRESS`), or a path (`NAME:FOLDER/NAME`).
    """

    name: str
    options: dict[str, Any]
    function: str = ""


def parse(text: str) -> PolicyName:
    """What a policy's name on the command line says.

    Raises:
        TaskError: it is of none of these forms.
    """
    if text.endswith(MODELS):
        return PolicyName(FILE, {"path": text})
    name, colon, rest = text.partition(":")
    if colon and "=" not in rest and "://" not in rest and name not in registry.names("env_policies"):
        if not all(part.isidentifier() for part in [*name.split("."), rest]):
            raise TaskError(f"--policy {text}: expected NAME, NAME:KEY=VALUE,…, MODULE:FUNCTION or FILE.onnx")
        return PolicyName(name, {}, rest)
    options: dict[str, Any] = {}
    for place, pair in enumerate(rest.split(",") if colon else ()):
        key, equals, value = pair.partition("=")
        if place == 0 and ("://" in key or os.sep in key or (not equals and Path(key).is_dir())):
            key, equals, value = "url" if "://" in key else "path", "=", pair
        if not equals or not key.isidentifier() or key in options:
            raise TaskError(f"--policy {text}: '{pair}' is no KEY=VALUE of its own, as in expert:sigma=0.03")
        options[key] = value if key in ("url", "path") else _value(value)
    return PolicyName(name, options)


def _value(text: str) -> Any:
    """A number, a truth value (`true` or `on`, `false` or `off`), or the words themselves."""
    try:
        return float(text)
    except ValueError:
        return yaml.safe_load(text) if text in ("true", "false", "on", "off") else text


def make_policy(env: TaskEnv, text: str) -> Policy:
    """The policy of a name for an env.

    Raises:
        PluginError: none of this name is installed.
        SpecError: at `policy.KEY`, a parameter that it does not take, or of another kind.
        TaskError: the name has another form, or the function is not there.
    """
    said = parse(text)
    if said.function:
        return FunctionPolicy(env, said.name, said.function)
    made = registry.load("env_policies", said.name)
    given = checked(options_model(made), said.options, "policy")
    return made(env, **{key: getattr(given, key) for key in parameters(made)})


def load_function(module: str, function: str) -> Callable[[Obs], Any]:
    """The function of `MODULE:FUNCTION`.

    Raises:
        TaskError: the module or the function is not there.
    """
    try:
        return getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError) as error:
        raise TaskError(
            f"--policy {module}:{function}: {error}; expected a module on the Python path, and a function in it"
        ) from None


class FunctionPolicy:
    """`MODULE:FUNCTION`: a function of the observations that gives actions (n, A), or chunks (n, K, A)."""

    def __init__(self, env: TaskEnv, module: str, function: str) -> None:
        self._function = load_function(module, function)

    def reset(self, env_ids: Array) -> None:
        """Nothing: a function remembers nothing."""

    def act(self, obs: Obs, env_ids: Array) -> Array:
        """What the function gives for these rows."""
        return np.asarray(self._function(obs))
