"""`world.collisions` and `self_collision`: names become pairs of bodies."""

import pytest

from anysim.compile.edit import without_entity
from anysim.compile.world import compile_world
from anysim.conventions import WORLD
from anysim.errors import SpecError
from anysim.model.world import World
from anysim_schemas.run import WorldSpec

BOX = {"source": {"box": [0.1, 0.1, 0.1]}}
OBJECTS = {"hammer": BOX, "saw": BOX, "peg": BOX, "table": {**BOX, "fixed": True}, "shelf": {**BOX, "fixed": True}}


def compiled(collisions: dict[str, object], **robots: dict[str, object]) -> World:
    layout = {name: {"position": [float(i), 0.0, 1.0]} for i, name in enumerate(OBJECTS)}
    data = {"robots": robots, "objects": OBJECTS, "layout": layout, "collisions": collisions}
    return compile_world(WorldSpec.model_validate(data))


def named(world: World) -> set[tuple[str, str]]:
    name = lambda body: "terrain" if body == WORLD else world.bodies[body].name  # noqa: E731
    return {(name(a), name(b)) for a, b in world.excluded_pairs}


def test_pairs_groups_and_the_ground() -> None:
    world = compiled(
        {"groups": {"tools": ["hammer", "saw"]}, "exclude": [["tools", "peg"], ["terrain", "saw"], ["peg", "table"]]}
    )
    assert named(world) == {("hammer", "peg"), ("saw", "peg"), ("terrain", "saw"), ("peg", "table")}
    assert world.hash != compiled({}).hash


def test_a_group_with_itself() -> None:
    """Its members ignore each other; what is fixed never meets what is fixed and is not listed."""
    world = compiled({"groups": {"all": ["hammer", "saw", "table", "shelf", "terrain"]}, "exclude": [["all", "all"]]})
    assert named(world) == {
        ("hammer", "saw"),
        ("hammer", "table"),
        ("saw", "table"),
        ("hammer", "shelf"),
        ("saw", "shelf"),
        ("terrain", "hammer"),
        ("terrain", "saw"),
    }


def test_links_and_robots() -> None:
    world = compiled({"exclude": [["arm.panda_leftfinger", "peg"]]}, arm={"robot": "franka_panda"})
    pairs = {pair for pair in named(world) if "peg" in pair}
    assert pairs == {("arm.panda_leftfinger", "peg")}
    world = compiled({"exclude": [["arm", "peg"]]}, arm={"robot": "franka_panda"})
    arm = world.entities[0]
    assert len([pair for pair in named(world) if "peg" in pair]) == arm.body_stop - arm.body_start


def test_self_collision_by_world() -> None:
    """The world overrides the catalogue; a robot excluded from itself is one without self-collision."""
    off = compiled({}, arm={"robot": "franka_panda"})
    on = compiled({}, arm={"robot": "franka_panda", "self_collision": True})
    own = compiled({"exclude": [["arm", "arm"]]}, arm={"robot": "franka_panda", "self_collision": True})
    assert on.excluded_pairs < off.excluded_pairs
    assert own.excluded_pairs == off.excluded_pairs
    parents = {(body.parent, i) for i, body in enumerate(off.bodies) if body.parent >= 0}
    assert not parents & off.excluded_pairs, "a parent and its child are not listed"


def test_specs_come_back_the_same() -> None:
    data = {"objects": OBJECTS, "collisions": {"exclude": [["peg", "saw"]]}, "layout": {}}
    layout = {name: {"position": [float(i), 0.0, 1.0]} for i, name in enumerate(OBJECTS)}
    spec = WorldSpec.model_validate({**data, "layout": layout})
    assert compile_world(WorldSpec.model_validate(spec.to_dict())).hash == compile_world(spec).hash


def test_a_removed_entity_takes_its_pairs_along() -> None:
    world = compiled({"exclude": [["peg", "saw"], ["terrain", "saw"], ["hammer", "peg"]]})
    assert named(without_entity(world, "peg")) == {("terrain", "saw")}


def test_all_wrong_names_at_once() -> None:
    with pytest.raises(SpecError) as caught:
        compiled(
            {"groups": {"tools": ["hammer", "sow"], "peg": ["saw"]}, "exclude": [["tols", "peg"], ["arm.hand", "peg"]]},
            arm={"robot": "franka_panda"},
        )
    found = {issue.path: issue.message for issue in caught.value.issues}
    assert set(found) == {
        "collisions.groups.tools.1",
        "collisions.groups.peg",
        "collisions.exclude.0.0",
        "collisions.exclude.1.0",
    }
    assert "did you mean 'saw'?" in found["collisions.groups.tools.1"]
    assert "did you mean 'tools'?" in found["collisions.exclude.0.0"]
    assert "'arm' has no link or tool 'hand'" in found["collisions.exclude.1.0"]
    assert "the name 'peg' is taken" in found["collisions.groups.peg"]
