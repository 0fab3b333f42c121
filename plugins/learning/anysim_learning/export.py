"""Networks as ONNX files that say what they observe and command; `anysim evaluate --policy FILE.onnx` runs them."""

import hashlib
import warnings
from collections.abc import Sequence
from json import dumps
from pathlib import Path
from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]

from anysim.record.commit import write_whole
from anysim.task.env import TaskEnv
from anysim_schemas.policy_file import FORMAT, METADATA, PolicyFileSpec, PolicyRobotSpec
from anysim_schemas.task import ObservationTermSpec


def described(env: TaskEnv, groups: Sequence[str], chunk: int = 1, images: Sequence[str] = ()) -> PolicyFileSpec:
    """What a file says of itself: what it observes, with sizes, its actions, and where it was trained."""
    return PolicyFileSpec(
        format=FORMAT,
        task=env.name,
        world=env.engine.world.hash,
        engine=f"{env.engine.name} {env.engine.version}",
        control_dt=env.engine.world.physics.control_dt,
        dt=env.engine.world.physics.dt,
        actuation=env.spec.physics.actuation,
        robots={name: _robot(env, name) for name in env.spec.world.robots},
        terms={} if env.spec.task is None else {g: _terms(env.spec.task.observations[g]) for g in groups},
        observations={group: env.observation_sizes[group] for group in groups},
        images={name: env.image_shapes[name] for name in images},
        actions=env.action_dim,
        chunk=chunk,
    )


def _terms(specs: Sequence[ObservationTermSpec]) -> tuple[dict[str, Any], ...]:
    return tuple(spec.model_dump(mode="json", exclude_defaults=True) for spec in specs)


def _robot(env: TaskEnv, name: str) -> PolicyRobotSpec:
    """A robot, nominally: what is drawn in episodes is about these values."""
    world = env.engine.world
    robot, entity = env.engine.index.robot(name), env.engine.index.entity(name)
    drives = [one for one in world.actuators if entity.joint_start <= one.joint < entity.joint_stop]
    entry = "" if robot.entry is None else dumps(robot.entry.model_dump(mode="json"), sort_keys=True)
    return PolicyRobotSpec(
        model=robot.model,
        hash=hashlib.sha256(entry.encode()).hexdigest(),
        drives=tuple(one.name.removeprefix(f"{name}.") for one in drives),
        home=tuple(world.joints[one.joint].initial for one in drives),
        kp=tuple(one.kp for one in drives),
        kd=tuple(one.kd for one in drives),
        effort_limit=tuple(one.effort_limit if np.isfinite(one.effort_limit) else None for one in drives),
        armature=tuple(world.joints[one.joint].armature for one in drives),
        actions={
            key: action.model_dump(mode="json", exclude_defaults=True)
            for key, action in env.spec.world.robots[name].actions.items()
        },
    )


def export(network: torch.nn.Module, about: PolicyFileSpec, path: Path) -> None:
    """Write a network whole or not at all.

    The network takes the groups of `about.observations` in order, (n, D) float32 each, and then `about.images`,
    (n, H, W, 3) uint8 each. It gives actions (n, A), or chunks (n, K, A), in the units of the env.
    """
    import onnx  # pyright: ignore[reportMissingImports]

    names = [*about.observations, *about.images]
    pictures = [torch.zeros(1, *shape, dtype=torch.uint8) for shape in about.images.values()]
    example = (*(torch.zeros(1, size) for size in about.observations.values()), *pictures)
    axes = {name: {0: "n"} for name in [*names, "action"]}
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_suffix(".draft")
    try:
        with warnings.catch_warnings():
            # The newer exporter needs a package more and writes the same few operators.
            warnings.simplefilter("ignore", DeprecationWarning)
            torch.onnx.export(
                network.eval(),
                example,
                str(draft),
                input_names=names,
                output_names=["action"],
                dynamic_axes=axes,
                opset_version=17,
                dynamo=False,
            )
        model = onnx.load(str(draft))
        note = model.metadata_props.add()
        note.key, note.value = METADATA, dumps(about.model_dump(), sort_keys=True)
        write_whole(path.parent, {path.name: model.SerializeToString()})
    finally:
        draft.unlink(missing_ok=True)
