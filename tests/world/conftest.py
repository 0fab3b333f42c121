"""Shared by the tests of the world package."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from anysim.world.compile import compile_world
from anysim.world.imported import ImportedModel
from anysim.world.model import World
from anysim.world.urdf import import_urdf
from anysim_schemas.run import WorldSpec

INERTIAL = '<inertial><mass value="{m}"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>'


@pytest.fixture
def inertial() -> Callable[[float], str]:
    """The text of an inertial of some mass."""
    return lambda mass: INERTIAL.format(m=mass)


@pytest.fixture
def urdf(tmp_path: Path) -> Callable[..., ImportedModel]:
    """Imports the body of a <robot> element from a file in tmp_path."""

    def load(body: str, **options: Any) -> ImportedModel:
        path = tmp_path / "arm.urdf"
        path.write_text(f'<?xml version="1.0"?>\n<robot name="arm">\n{body}\n</robot>\n')
        return import_urdf(path, root=tmp_path, **options)

    return load


@pytest.fixture
def world() -> Callable[..., World]:
    """Compiles a world given as plain data."""

    def make(base: Path | None = None, **content: Any) -> World:
        return compile_world(WorldSpec.model_validate(content), base=base)

    return make


@pytest.fixture(scope="session")
def panda() -> World:
    """A world with the catalogue's Panda alone."""
    return compile_world(WorldSpec.model_validate({"robots": {"panda": {"robot": "franka_panda"}}}))
