"""A resolver with a few plugins, as a program that loads files would pass one."""

from collections.abc import Callable
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, ConfigDict, Field

from anysim_schemas.plugin import OptionsResolver, UnknownPlugin


class Closed(BaseModel):
    model_config = ConfigDict(extra="forbid")


class MujocoOptions(Closed):
    solver: Literal["newton", "cg", "pgs"] = "newton"
    iterations: Annotated[int, Field(gt=0)] = 100
    threads: int | Literal["auto"] = "auto"


class JointDelta(Closed):
    scale: Annotated[float, Field(gt=0, description="largest change per step [rad]")] = 0.1
    limits: tuple[float, float] | None = None


class Distance(Closed):
    a: str
    b: str
    offsets: dict[str, tuple[float, float, float]] = {}


class Above(Closed):
    table: str
    height: float


class Near(Closed):
    object: str
    tolerance: Annotated[float, Field(gt=0)] = 0.02


class PickPlace(Closed):
    object: str
    grasp_height: float = 0.0


PLUGINS: dict[tuple[str, str], type[BaseModel] | None] = {
    ("engine", "mujoco"): MujocoOptions,
    ("engine", "plain"): None,
    ("controller", "joint_delta_position"): JointDelta,
    ("controller", "gripper_binary"): None,
    ("observation", "joint_pos"): None,
    ("observation", "tool_pose"): None,
    ("observation", "distance"): Distance,
    ("reward", "distance"): Distance,
    ("command", "above"): Above,
    ("predicate", "near"): Near,
    ("predicate", "at_rest"): None,
    ("event", "near"): Near,
    ("skill", "pick_place"): PickPlace,
    ("writer", "mcap"): None,
}


@pytest.fixture
def resolver() -> OptionsResolver:
    def resolve(kind: str, name: str) -> type[BaseModel] | None:
        if (kind, name) not in PLUGINS:
            installed = ", ".join(other for k, other in PLUGINS if k == kind)
            raise UnknownPlugin(f"no {kind} named '{name}' is installed (installed: {installed})")
        return PLUGINS[kind, name]

    return resolve


@pytest.fixture
def write(tmp_path, monkeypatch) -> Callable[..., None]:
    """Writes files into an empty current directory: `write(a="x: 1")` makes a.yaml."""
    monkeypatch.chdir(tmp_path)

    def make(**files: str) -> None:
        for name, text in files.items():
            (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")

    return make
