"""Frozen parts of a protocol: all that its figures depend on, in words and hashes, in a file beside it."""

import hashlib
import importlib.util
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from anysim import registry
from anysim.api import compile_world, load as load_task
from anysim.assets.uri import locate
from anysim.engine.factory import availability
from anysim.errors import AssetError, PluginError, RecordError, SpecError
from anysim.math import statistics
from anysim.plugin_parameters import checked, options_model
from anysim.record.commit import write_whole
from anysim.task.snapshot import spec_hash
from anysim_evaluation import driver, policy as policies, summary
from anysim_evaluation.benchmark import ranks, results
from anysim_evaluation.benchmark.protocol import Protocol, overrides

FORMAT = "anysim-frozen-1"
METRIC_CODE = (driver, summary, statistics, ranks, results)
"""The modules whose code makes figures of episodes."""
SHIPPED = "shipped"
"""The policy that comes with a task."""


def parts(protocol: Protocol) -> dict[str, str]:
    """All that the figures depend on, in words or as a SHA-256, by dotted keys; the same wherever it is run.

    Raises:
        SpecError: a task, engine or policy that is not what the protocol asks for; with the place.
        PluginError: one that is not installed.
    """
    spec = protocol.spec
    seeds = protocol.seeds()
    return {
        "metrics": _hash(Path(str(module.__file__)) for module in METRIC_CODE),
        "seeds": f"{spec.seeds.split}, {seeds[0]} to {seeds[-1]}",
        "modality": ", ".join(spec.modality),
        "privileged": "allowed" if spec.privileged else "not allowed",
        "reference": f"{spec.reference.policy} on {spec.reference.engine}",
        **dict(_engine_parts(protocol)),
        **dict(_policy_parts(protocol)),
        **dict(_task_parts(protocol)),
    }


def _hash(paths: Iterator[Path]) -> str:
    digest = hashlib.sha256()
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _engine_parts(protocol: Protocol) -> Iterator[tuple[str, str]]:
    for name, engine in protocol.spec.engines.items():
        here = availability(engine.engine)
        if not here.available:
            words = f"{engine.engine} cannot run here: {'; '.join(here.missing)}. {here.remedy}"
            raise protocol.fault(f"engines.{name}", words)
        if engine.version not in (None, here.version):
            words = f"{engine.engine} {here.version} is installed, and the protocol asks for {engine.version}"
            raise protocol.fault(f"engines.{name}.version", words)
        options = f" {json.dumps(engine.options, sort_keys=True)}" if engine.options else ""
        yield f"engines.{name}", f"{engine.engine} {here.version}{options}"


def _policy_parts(protocol: Protocol) -> Iterator[tuple[str, str]]:
    for name, policy in protocol.spec.policies.items():
        key = f"policies.{name}"
        said, words = policies.parse(policy.policy), policy.policy
        if said.function:
            try:
                found = importlib.util.find_spec(said.name)
            except ImportError:
                found = None
            if found is None or found.origin is None:
                raise protocol.fault(key, f"there is no module '{said.name}' on the Python path")
            words += f" ({_hash(iter([Path(found.origin)]))})"
        else:
            try:
                checked(options_model(registry.load("env_policies", said.name)), said.options, key)
            except PluginError as error:
                raise protocol.fault(key, str(error)) from None
            except SpecError as error:
                raise protocol.fault(key, "; ".join(f"{i.path}: {i.message}" for i in error.issues)) from None
            if said.name == policies.FILE:
                try:
                    words += f" ({_hash(iter([Path(said.options['path'])]))})"
                except OSError as error:
                    raise protocol.fault(key, f"{policy.policy} cannot be read: {error.strerror}") from None
        yield key, words + (" (privileged)" if policy.privileged else "")


def _task_parts(protocol: Protocol) -> Iterator[tuple[str, str]]:
    named = {policies.parse(policy.policy).name for policy in protocol.spec.policies.values()}
    for name, task in protocol.spec.tasks.items():
        loaded = load_task(protocol.source(name), overrides=overrides(task))
        spec = loaded.spec
        if spec.task is None:
            raise protocol.fault(f"tasks.{name}", f"{task.task} has no task; a benchmark needs one that can be solved")
        rate = 1.0 / spec.physics.control_dt
        wanted = protocol.spec.control_rate
        if wanted is not None and abs(rate - wanted) > 1e-6 * wanted:
            raise protocol.fault(
                "control_rate",
                f"the task '{name}' takes {rate:g} actions in a second, the protocol asks for {wanted:g}",
            )
        yield f"tasks.{name}.robots", ", ".join(f"{key} ({robot.robot})" for key, robot in spec.world.robots.items())
        yield f"tasks.{name}.control_rate", f"{rate:g} Hz"
        yield f"tasks.{name}.horizon", f"{spec.task.horizon} steps"
        yield f"tasks.{name}.spec", spec_hash(spec)
        yield f"tasks.{name}.world", compile_world(loaded).hash
        if spec.task.shipped and SHIPPED in named:
            try:
                yield f"tasks.{name}.shipped", _hash(iter([locate(spec.task.shipped).path]))
            except AssetError as error:
                raise protocol.fault(f"tasks.{name}", f"task.shipped: {error}") from None


def hash_of(said: Mapping[str, str]) -> str:
    """One SHA-256 of frozen parts."""
    return hashlib.sha256(json.dumps(dict(sorted(said.items()))).encode()).hexdigest()


def of_cell(said: Mapping[str, str], task: str, engine: str, policy: str) -> str:
    """The SHA-256 of those parts that the episodes of one policy on one engine depend on."""
    own = {f"engines.{engine}", f"policies.{policy}", "metrics", "modality", "privileged"}
    return hash_of({key: words for key, words in said.items() if key in own or key.startswith(f"tasks.{task}.")})


def freeze(protocol: Protocol) -> tuple[str, list[str]]:
    """Write what is frozen beside the protocol.

    Returns:
        The hash, and what has moved since it was frozen before, in words.
    """
    now = parts(protocol)
    moved = differences(_read(protocol), now) if protocol.frozen.exists() else []
    text = json.dumps({"format": FORMAT, "hash": hash_of(now), "parts": now}, indent=1) + "\n"
    write_whole(protocol.frozen.parent, {protocol.frozen.name: text})
    return hash_of(now), moved


def _read(protocol: Protocol) -> dict[str, str]:
    try:
        data: dict[str, Any] = json.loads(protocol.frozen.read_text("utf-8"))
        if data["format"] == FORMAT and hash_of(data["parts"]) == data["hash"]:
            return data["parts"]
        problem = "its hash is not that of its parts"
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        problem = f"it cannot be read ({error})"
    raise RecordError(
        f"{protocol.frozen} is not what was frozen: {problem}; `anysim benchmark freeze {protocol.path}` writes it anew"
    )


def differences(was: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """What has moved, a few words each."""
    return [
        _moved(key, was.get(key), now.get(key))
        for key in [*was, *(k for k in now if k not in was)]
        if was.get(key) != now.get(key)
    ]


def _moved(key: str, was: str | None, now: str | None) -> str:
    if was is None or now is None:
        return f"{key} is {'new' if was is None else 'gone'}"
    long = max(len(was), len(now)) > 60
    return f"{key} has changed" if long else f"{key} was {was} and is {now}"


def moved(protocol: Protocol, now: Mapping[str, str]) -> list[str]:
    """What is not as it was frozen, in words; policies that were added on the command line aside.

    Raises:
        RecordError: it was never frozen, or what was written is damaged.
    """
    if not protocol.frozen.exists():
        raise RecordError(f"{protocol.path} is not frozen yet; run `anysim benchmark freeze {protocol.path}` first")
    added = {f"policies.{name}" for name in protocol.added}
    return differences(_read(protocol), {key: words for key, words in now.items() if key not in added})
