"""Directories that LeRobot's `save_pretrained` wrote: what is in them is checked, and loaded without unpickling."""

import hashlib
import io
import json
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

from anysim.errors import PluginError, TaskError, listing
from anysim_schemas.files import RefusedFileError, open_plain, read_plain
from anysim_schemas.limits import JSON_BYTES

CONFIG, WEIGHTS = "config.json", "model.safetensors"
PREPROCESSOR, POSTPROCESSOR = "policy_preprocessor.json", "policy_postprocessor.json"
_BLOCK = 1 << 20


class LoadedPolicy(NamedTuple):
    """A policy of LeRobot, ready to run.

    Attributes:
        policy: the module, in evaluation mode.
        before: from observations as they are to those that the module takes.
        after: from the module's actions to those of the robot.
        config: what the directory says of it.
        version: the digest of all its files.
    """

    policy: Any
    before: Any
    after: Any
    config: Any
    version: str


def load_directory(folder: Path, device: str) -> LoadedPolicy:
    """The policy of a directory.

    Raises:
        PluginError: lerobot is not installed.
        TaskError: the directory lacks a file, names code, does not fit together, or is of an older LeRobot.
    """
    said = _said(folder)
    version = _digest(folder, [CONFIG, WEIGHTS, PREPROCESSOR, POSTPROCESSOR, *said.states])
    try:
        import draccus  # pyright: ignore[reportMissingImports]
        from lerobot.configs.policies import PreTrainedConfig  # pyright: ignore[reportMissingImports]
        from lerobot.policies import factory  # pyright: ignore[reportMissingImports]
        from torch.random import fork_rng  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise PluginError(
            f"LeRobot's policies need lerobot ({error}): pip install 'anysim-policy[lerobot]', best in an environment "
            "of its own"
        ) from None
    try:
        with redirect_stdout(io.StringIO()), fork_rng(devices=[]):  # it prints, and draws weights that it then replaces
            with draccus.config_type("json"):
                config = draccus.parse(PreTrainedConfig, str(folder / CONFIG), args=[])
            config.device = device
            if hasattr(config, "pretrained_backbone_weights"):
                config.pretrained_backbone_weights = None  # they would be downloaded, and are replaced by those here
            policy = factory.get_policy_class(config.type).from_pretrained(str(folder), config=config, strict=True)
            # The names of what is observed are given as the policy has them, so nothing is renamed.
            settings = {"device_processor": {"device": device}, "rename_observations_processor": {"rename_map": {}}}
            before, after = factory.make_pre_post_processors(
                config,
                str(folder),
                preprocessor_overrides={step: settings[step] for step in said.before if step in settings},
                postprocessor_overrides={},
            )
    except Exception as error:
        words = str(error).strip().splitlines()
        raise TaskError(f"the policy {folder} cannot be loaded by lerobot: {words[0] if words else error!r}") from error
    return LoadedPolicy(policy, before, after, config, version)


class _StepFiles(NamedTuple):
    before: tuple[str, ...]
    states: tuple[str, ...]


def _said(folder: Path) -> _StepFiles:
    """The steps before the policy, and the files with the numbers of all steps."""
    if not folder.is_dir():
        raise TaskError(f"the policy {folder} is no directory; expected one that LeRobot's save_pretrained wrote")
    for name in (CONFIG, WEIGHTS):
        if not (folder / name).exists():
            there = listing(sorted(path.name for path in folder.iterdir()), 10)
            raise TaskError(f"the policy {folder} has no {name} (there: {there}); LeRobot's save_pretrained writes it")
    about = _json(folder, CONFIG)
    if about.get("use_peft"):
        raise TaskError(f"the policy {folder} is an adapter of another model; merge it into the model and save that")
    before, states = list[str](), list[str]()
    for name in (PREPROCESSOR, POSTPROCESSOR):
        if not (folder / name).exists():
            raise TaskError(
                f"the policy {folder} has no {name}, which says how its numbers are scaled; save its processors beside "
                "it, or bring a policy of LeRobot before 0.4 up to date with "
                "`python -m lerobot.processor.migrate_policy_normalization`"
            )
        steps = _json(folder, name).get("steps")
        for step in steps if isinstance(steps, list) else ():
            known = step.get("registry_name") if isinstance(step, dict) else None
            if not isinstance(known, str) or "class" in step:
                raise TaskError(
                    f"the policy {folder}: {name} names code to import ({json.dumps(step)[:80]}); only LeRobot's "
                    "registered steps are run"
                )
            state = step.get("state_file")
            if state is not None:
                if not isinstance(state, str) or Path(state).name != state or not (folder / state).exists():
                    raise TaskError(f"the policy {folder}: {name} keeps numbers in {state!r}, no file of its folder")
                states.append(state)
            if name == PREPROCESSOR:
                before.append(known)
    return _StepFiles(tuple(before), tuple(states))


def _json(folder: Path, name: str) -> dict[str, Any]:
    try:
        found = json.loads(read_plain(folder / name, JSON_BYTES))
    except RefusedFileError as error:
        raise TaskError(f"the policy {folder}: {name} {error.strerror}") from error
    except (OSError, ValueError, RecursionError) as error:
        raise TaskError(f"the policy {folder}: {name} is no JSON: {error}") from error
    if not isinstance(found, dict):
        raise TaskError(f"the policy {folder}: {name} is no JSON mapping, as LeRobot writes it")
    return found


def _digest(folder: Path, names: list[str]) -> str:
    """Of the files' content, which may be gigabytes."""
    total = hashlib.sha256()
    for name in names:
        try:
            with open_plain(folder / name) as file:
                while block := file.read(_BLOCK):
                    total.update(block)
        except OSError as error:
            raise TaskError(f"the policy {folder}: {name} cannot be read: {error.strerror}") from error
    return total.hexdigest()[:16]
