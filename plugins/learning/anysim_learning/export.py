"""Networks as ONNX files that say what they observe and command; `anysim evaluate --policy FILE.onnx` runs them."""

import warnings
from collections.abc import Sequence
from json import dumps
from pathlib import Path

import torch  # pyright: ignore[reportMissingImports]

from anysim.record.commit import write_whole
from anysim.task.env import TaskEnv
from anysim_schemas.policy_file import FORMAT, METADATA, PolicyFileSpec


def described(env: TaskEnv, groups: Sequence[str], chunk: int = 1, images: Sequence[str] = ()) -> PolicyFileSpec:
    """What a file says of itself: what it observes, with sizes, its actions, and where it was trained."""
    return PolicyFileSpec(
        format=FORMAT,
        task=env.name,
        world=env.engine.world.hash,
        engine=f"{env.engine.name} {env.engine.version}",
        control_dt=env.engine.world.physics.control_dt,
        observations={group: env.observation_sizes[group] for group in groups},
        images={name: env.image_shapes[name] for name in images},
        actions=env.action_dim,
        chunk=chunk,
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
