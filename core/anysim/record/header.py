"""Headers: all that is known of a run or a trajectory before its first frame. They go to disk as they are."""

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib import metadata
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field, field_validator

from anysim import registry
from anysim.conventions import Array
from anysim.model.world import Camera, World
from anysim_schemas.base import Name, Positive, Spec

MAX_VALUES = 1 << 20
"""No array of one frame has more numbers than this."""

Count = Annotated[int, Field(ge=0, lt=1 << 53)]
Size = Annotated[int, Field(ge=0, le=MAX_VALUES)]
Label = Annotated[str, Field(max_length=1024)]
Pose7 = tuple[float, float, float, float, float, float, float]
NumberType = Literal["float64", "float32", "int32", "uint16", "int8", "uint8", "bool"]


class ArrayLayout(Spec):
    """Shape and number type of an array of one env."""

    shape: tuple[Size, ...]
    dtype: Literal["float32", "float64"] = "float64"


class StateLayout(Spec):
    """The meaning of a frame's arrays, by name, so that a reader needs no engine and no world.

    `action` names the components of an action; `state` gives the shape of each state array, `dtypes` the number type of
    those that are not float64; `obs` the observation groups.
    """

    bodies: tuple[Label, ...] = ()
    joints: tuple[Label, ...] = ()
    actuators: tuple[Label, ...] = ()
    action: tuple[Label, ...] = ()
    state: dict[Name, tuple[Size, ...]] = Field(default_factory=dict)
    dtypes: dict[Name, NumberType] = Field(default_factory=dict)
    obs: dict[Name, ArrayLayout] = Field(default_factory=dict)

    @field_validator("state")
    @classmethod
    def _not_a_clock(cls, state: dict[str, Any]) -> dict[str, Any]:
        taken = sorted({"step", "time"} & state.keys())
        if taken:
            raise ValueError(f"{taken[0]} is recorded by itself and cannot be a state array; choose another name")
        return state

    def dtype(self, name: str) -> str:
        """The number type of a state array."""
        return self.dtypes.get(name, "float64")


class CameraInfo(Spec):
    """A camera whose images are recorded.

    `pose` [x, y, z, qx, qy, qz, qw] is that of its optical frame in `parent` (a body, or `world`); `fov` is vertical
    [degrees]. An image belongs to each control step that `every` divides.
    """

    width: Annotated[int, Field(gt=0, le=8192)]
    height: Annotated[int, Field(gt=0, le=8192)]
    every: Annotated[int, Field(gt=0)] = 1
    fov: Annotated[float, Field(gt=0, lt=180)] = 60.0
    parent: Label = "world"
    pose: Pose7 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class StreamInfo(Spec):
    """What the rows of a stream are.

    An `image` is an array (H, W) of float32, uint16 or uint8, or (H, W, 3) of uint8, `points` one (K, 3) of float32,
    `data` plain data. A size of None differs from row to row. `frame` is what images and points are in, `about` what
    else is to be known once: a legend, parameters.
    """

    kind: Literal["array", "image", "points", "text", "data"]
    shape: tuple[Size | None, ...] = ()
    dtype: NumberType = "float64"
    unit: Label = "1"
    words: Label = ""
    frame: Label = "world"
    about: dict[str, Any] = Field(default_factory=dict)


class RunHeader(Spec):
    """What all trajectories of a run have in common."""

    task: Label
    seed: Count
    engine: Label
    engine_version: Label
    world_hash: Label
    control_dt: Positive = Field(description="[s]")
    layout: StateLayout
    spec: dict[str, Any] = Field(default_factory=dict, description="the resolved RunSpec, as plain data")
    packages: dict[str, str] = Field(default_factory=dict, description="versions of the distributions involved")
    notes: tuple[str, ...] = Field(default=(), description="what the world's sources say that is not so in it")

    @field_validator("spec")
    @classmethod
    def _whole(cls, spec: dict[str, Any]) -> dict[str, Any]:
        if "extends" in spec:
            raise ValueError("a recorded spec is whole and extends no file; take `extends` out")
        return spec


class EpisodeHeader(Spec):
    """One trajectory of a run: which env, which episode, and what was drawn for it."""

    env: Annotated[int, Field(ge=0, lt=10**9)]
    episode: Annotated[int, Field(ge=0, lt=10**9)]
    episode_seed: Annotated[int, Field(ge=0)]
    drawn: dict[str, Any] = Field(default_factory=dict, description="randomised values, by name")
    overridden: dict[str, Any] = Field(
        default_factory=dict, description="values set for this episode instead of drawn ones, by dotted path"
    )
    instruction: str = Field(default="", max_length=1 << 16, description="the task in words, for this episode")
    cameras: dict[Name, CameraInfo] = Field(default_factory=dict)


class Header(NamedTuple):
    """Everything a writer knows when it begins."""

    run: RunHeader
    episode: EpisodeHeader


def state_layout(
    world: World,
    fields: Iterable[str],
    action: Sequence[str],
    obs: Mapping[str, Array] | None = None,
    sensors: Mapping[str, Array] | None = None,
) -> StateLayout:
    """The layout of frames of a World.

    Args:
        fields: names of `State` arrays and of `control_position`, `control_velocity`, `control_effort`.
        action: names of the action's components.
        obs: an example of one env's observation groups; `images/…` are left out.
        sensors: arrays (n, …) of what is recorded of sensors.
    """
    bodies, joints, drives = len(world.bodies), len(world.joints), len(world.actuators)
    shapes = {
        "body_pose": (bodies, 7), "body_twist": (bodies, 6),
        "joint_pos": (joints,), "joint_vel": (joints,), "joint_effort": (joints,),
        "contact_force": (len(world.contact_sensors), 3),
        "control_position": (drives,), "control_velocity": (drives,), "control_effort": (drives,),
    }  # fmt: skip
    groups = {} if obs is None else {k: v for k, v in obs.items() if not k.startswith("images/")}
    return StateLayout(
        bodies=tuple(b.name for b in world.bodies),
        joints=tuple(j.name for j in world.joints),
        actuators=tuple(a.name for a in world.actuators),
        action=tuple(action),
        state={name: shapes[name] for name in fields} | {name: a.shape[1:] for name, a in (sensors or {}).items()},
        dtypes=StateLayout.model_validate(
            {"dtypes": {name: str(a.dtype) for name, a in (sensors or {}).items() if a.dtype != np.float64}}
        ).dtypes,
        obs={k: ArrayLayout.model_validate({"shape": v.shape, "dtype": str(v.dtype)}) for k, v in groups.items()},
    )


def camera_info(
    world: World, camera: Camera, every: int, pose: Array | None = None, fov: float | None = None
) -> CameraInfo:
    """A camera of a World as a recorder wants it.

    `pose` (7,) and `fov` [degrees] override those in the World: they may be other ones in each episode.
    """
    values = [*camera.position, *camera.quaternion] if pose is None else [float(x) for x in pose]
    return CameraInfo.model_validate(
        {
            "width": camera.width,
            "height": camera.height,
            "every": every,
            "fov": camera.fov if fov is None else fov,
            "parent": "world" if camera.body < 0 else world.bodies[camera.body].name,
            "pose": tuple(values),
        }
    )


_NAME = re.compile(r"[A-Za-z0-9._-]+")


def package_versions() -> dict[str, str]:
    """Versions of the distributions that offer something to anysim and of what they require directly, sorted by name.

    Extras are left out; what is not installed is not listed, but what offers a module of its name is, as `mujoco-core`
    does for `mujoco`.
    """
    return dict(_versions(tuple(registry.participants())))


@cache
def _versions(participants: tuple[str, ...]) -> dict[str, str]:
    """Versions of these distributions and of their requirements: once for all runs of a process."""
    known = {_normal(name): registry.participants()[name] for name in participants}
    names = set(known)
    for dist in [*known.values(), _installed("anysim-schemas")]:
        for requirement in (dist.requires if dist else None) or []:
            found = _NAME.match(requirement)
            if found is not None and "extra ==" not in requirement:
                names.add(_normal(found[0]))
    present = {name: known.get(name) or _installed(name) for name in names}
    if missing := [name for name, dist in present.items() if dist is None]:
        offering = metadata.packages_distributions()  # reads the files of all distributions: half a second
        others = {_normal(other) for name in missing for other in offering.get(name.replace("-", "_"), ())}
        present |= {other: _installed(other) for other in others}
    return {name: dist.version for name, dist in sorted(present.items()) if dist is not None}


def _installed(name: str) -> metadata.Distribution | None:
    try:
        return metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return None


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
