"""Calls of SAPIEN that end the process or lie, and that are therefore never made."""

import ast
from pathlib import Path

import pytest

import anysim_sapien

FILES = sorted(Path(anysim_sapien.__file__).parent.glob("*.py"))


def names(file: Path) -> set[str]:
    """Every name and attribute that a file uses."""
    tree = ast.parse(file.read_text("utf-8"))
    used = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    return used | {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}


@pytest.mark.parametrize(
    "call",
    [
        "create_urdf_loader",  # a file with visuals ends the process where there is no renderer; it drops friction
        "create_actor_builder",  # its bodies share one material and keep PhysX' damping and sleep
        "create_articulation_builder",
        "get_default_material",  # one object for all bodies: a change of one changes all
        "set_default_material",
    ],
)
def test_calls_that_lie_are_not_made(call):
    """Everything is built from the World, shape by shape."""
    for file in FILES:
        assert call not in names(file), file.name


def test_names_are_found():
    """The check above looks into the files that build scenes."""
    used = set().union(*(names(file) for file in FILES))
    assert {"PhysxCollisionShapeConvexMesh", "PhysxArticulationLinkComponent", "set_scene_config"} <= used
