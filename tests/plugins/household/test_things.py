"""The pack of household things: every name is a thing with words, what is heavy is as heavy as said, and all rest."""

from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim import registry
from anysim.assets.procedural import build
from anysim.errors import SpecError
from anysim.math import pose as P
from anysim_household.pack import built, pack, things
from anysim_household.spec import MaterialSpec, PackSpec, ThingSpec
from anysim_household.things import OBJECTS
from anysim_language.vocabulary import VocabularySpec
from anysim_schemas.jsonschema import render
from anysim_schemas.load import load

NAMES = sorted(things(OBJECTS))
SLOW = [pytest.param(engine, marks=pytest.mark.slow) for engine in ("pybullet", "sapien")]


def test_there_is_a_builder_and_a_noun_for_each() -> None:
    found = {name for name in registry.names("assets") if registry.distribution("assets", name) == "anysim-household"}
    words = load(VocabularySpec, OBJECTS.parent / "words.yaml").spec
    assert len(NAMES) >= 60
    assert found == set(NAMES) == set(words.things)
    for name in NAMES:
        assert set(words.things[name].parts) == set(things(OBJECTS)[name][0].links), name


@pytest.mark.parametrize("name", NAMES)
def test_a_thing_has_its_mass_its_frames_and_something_to_hold(name: str) -> None:
    spec, model = things(OBJECTS)[name][0], build(name, {})
    assert np.isclose(sum(body.inertial.mass for body in model.bodies), spec.mass, rtol=1e-9)
    for joint in model.joints:
        assert joint.lower <= 0.0 <= joint.upper
    geoms = {geom.name for geom in model.geoms}
    for affordance in model.affordances:
        assert set(affordance.pieces) <= geoms
    assert {site.name for site in model.sites} == set(spec.frames)


def test_the_schema_for_editors_is_that_of_packs() -> None:
    assert (OBJECTS / "pack.schema.json").read_text("utf-8") == render(PackSpec), "write the right side into it"


def test_a_colour_is_that_of_the_first_material_alone() -> None:
    red = build("hammer", {"color": [1.0, 0.0, 0.0]})
    colors = {geom.name: geom.color[:3] for geom in red.geoms}
    assert colors["base.handle"] == (1.0, 0.0, 0.0)
    assert colors["base.head"] == {geom.name: geom.color[:3] for geom in build("hammer", {}).geoms}["base.head"]


def test_a_shell_holds_what_is_put_into_it_and_has_the_mass_of_its_wall() -> None:
    """A straight vessel by hand: a disc and a wall around it, as heavy as one whose boards do not overlap."""
    shell = {"foot": 0.05, "rim": 0.05, "height": 0.1, "wall": 0.004, "boards": 32}
    thing = ThingSpec.model_validate({"mass": 1.0, "pieces": {"wall": {"shell": shell, "of": "a"}, "dot": dot(0.01)}})
    model = built("cup", thing, {"a": MaterialSpec(density=1000.0, color="red")})
    disc, wall = np.pi * 0.05**2 * 0.004, np.pi * (0.054**2 - 0.05**2) * 0.096
    height = (disc * 0.002 + wall * 0.052) / (disc + wall)
    dots = 4 / 3 * np.pi * 0.01**3
    expected = (height * (disc + wall) + 0.05 * dots) / (disc + wall + dots)
    assert np.isclose(model.bodies[0].inertial.com[2], expected, rtol=0.03)


def dot(radius: float) -> dict[str, object]:
    return {"sphere": radius, "at": [0.0, 0.0, 0.05], "of": "a"}


@pytest.mark.parametrize("engine", ["mujoco", *SLOW])
def test_all_of_them_rest_where_they_are_put(engine: str) -> None:
    world = {"terrain": {"kind": "plane"}, "objects": {}, "layout": {}}
    for number, name in enumerate(NAMES):
        world["objects"][name] = {"source": f"procedural:{name}"}
        world["layout"][name] = {"position": [0.55 * (number % 10), 0.55 * (number // 10), 0.002]}
    run = {"engine": engine, "physics": {"dt": 0.002, "control_dt": 0.02}, "world": world}
    with anysim.make({**run, "task": {"observations": {"policy": ["last_action"]}}}) as env:
        env.reset(seed=0)
        before = env.engine.get_state().body_pose[0].copy()
        for _ in range(25):
            env.step([[]])
        after = env.engine.get_state()
        roots = {entity.name: entity.root for entity in env.engine.world.entities if entity.name in NAMES}
    for name, root in roots.items():
        a, b = before[root], after.body_pose[0, root]
        assert np.linalg.norm(b[:2] - a[:2]) < 0.005, name
        assert abs(b[2]) < 0.002, name
        up = P.rotate(np.stack([a[3:], b[3:]]), np.array([0.0, 0.0, 1.0]))
        lying = any(p.sphere or (p.axis[2] == 0.0 and not p.box) for p in things(OBJECTS)[name][0].pieces.values())
        assert lying or float(up[0] @ up[1]) > np.cos(0.02), name


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("{mass: 1.0, pieces: {a: {box: [1, 1, 1], sphere: 0.1}}}", "a piece has one form"),
        ("{mass: 1.0, pieces: {a: {sphere: 0.1, link: lid}}}", "speaks of the link 'lid'; there are: base"),
        ("{mass: -1.0, pieces: {a: {sphere: 0.1}}}", "mass"),
    ],
)
def test_a_wrong_file_is_told_with_its_line(tmp_path: Path, said: str, expected: str) -> None:
    (tmp_path / "a.yaml").write_text(f"things:\n  thing: {said}\n")
    with pytest.raises(SpecError, match=expected) as caught:
        things(tmp_path)
    assert "a.yaml:2" in str(caught.value)


def test_a_pack_of_a_stranger_has_its_own_materials(tmp_path: Path) -> None:
    materials = "materials: {cork: {density: 200.0, color: beige}}"
    said = f"{materials}\nthings: {{mat: {{mass: 0.1, pieces: {{a: {{box: [0.2, 0.2, 0.01], of: cork}}}}}}}}"
    (tmp_path / "mine.yaml").write_text(said)
    model = pack(tmp_path)("mat")()
    assert np.isclose(model.bodies[0].inertial.mass, 0.1)
    with pytest.raises(AttributeError, match="no thing 'rug'"):
        pack(tmp_path)("rug")


def test_two_things_of_one_name_are_told_with_the_file(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.yaml").write_text("things: {mat: {mass: 0.1, pieces: {a: {sphere: 0.1}}}}\n")
    with pytest.raises(SpecError, match="another file of the pack has mat already") as caught:
        things(tmp_path)
    assert "b.yaml" in str(caught.value)
