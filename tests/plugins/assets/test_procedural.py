"""Procedural assets: solids that fit together, masses that follow, and what a file may ask of a builder."""

from collections.abc import Iterator
from itertools import combinations, pairwise
from math import inf, pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim import api, registry
from anysim.assets.load import import_asset
from anysim.assets.procedural import build
from anysim.compile.world import compile_world
from anysim.errors import AssetError, PluginError, SpecError
from anysim.geometry.bounds import shape_bounds
from anysim.kinematics import inertia
from anysim.model.forward_kinematics import forward_kinematics
from anysim.model.world import BodyKind, Box, Capsule, Cylinder, Geom, JointType, Sphere, World
from anysim.plugin_parameters import parameters
from anysim_schemas.run import WorldSpec

BUILDERS = [name for name in registry.names("assets") if registry.distribution("assets", name) == "anysim-assets"]

CABINETS: dict[str, dict[str, Any]] = {
    "default": {},
    "one drawer": {"columns": [["drawer"]], "size": [0.36, 0.34, 0.18], "base": 0.0},
    "wide": {
        "size": [0.5, 1.8, 0.9], "widths": [1, 2, 1], "gap": 0.005,
        "columns": [["drawer", "drawer"], ["double_door", "open"], [{"front": "door", "height": 2}, "panel"]],
    },
    "knobs": {"handle": {"style": "knob", "standoff": 0.03, "radius": 0.01}},
    "bare": {"handle": {"style": "none"}},
}  # fmt: skip


def world_of(source: Any, **more: Any) -> World:
    spec = {"objects": {"it": {"source": source, "fixed": True, **more}}, "layout": {"it": {"position": [0, 0, 0]}}}
    return compile_world(WorldSpec.model_validate(spec))


def complaints(**content: Any) -> list[str]:
    with pytest.raises(SpecError) as caught:
        compile_world(WorldSpec.model_validate({"objects": {"it": content}}))
    return [str(issue) for issue in caught.value.issues]


# ---------------------------------------------------------------------- how they are made


@pytest.mark.parametrize("params", CABINETS.values(), ids=list(CABINETS))
def test_the_boards_of_a_cabinet_do_not_overlap_and_those_of_two_links_keep_a_gap(params: dict[str, Any]) -> None:
    world = world_of({"procedural": "cabinet", "params": params})
    gap = params.get("gap", 0.003)
    boxes = [geom for geom in world.geoms if isinstance(geom.shape, Box)]
    assert len(boxes) > 8
    low, high = _bounds(world, boxes)
    for i, k in combinations(range(len(boxes)), 2):
        apart = np.maximum(low[i] - high[k], low[k] - high[i]).max()
        same = boxes[i].body == boxes[k].body
        assert apart >= (-1e-9 if same else gap - 1e-9), (boxes[i].name, boxes[k].name)


@pytest.mark.parametrize("params", CABINETS.values(), ids=list(CABINETS))
def test_a_cabinet_has_its_size_and_stands_on_its_frame(params: dict[str, Any]) -> None:
    """Handles stand out of the front; nothing else does."""
    world = world_of({"procedural": "cabinet", "params": params})
    depth, width, height = params.get("size", (0.45, 0.6, 0.7))
    boards = [geom for geom in world.geoms if isinstance(geom.shape, Box)]
    low, high = (end.min(axis=0) if i == 0 else end.max(axis=0) for i, end in enumerate(_bounds(world, boards)))
    assert np.allclose([*low[:2], high[1], high[2]], [-depth / 2, -width / 2, width / 2, height], atol=1e-9)
    assert 0.0 <= low[2] <= 0.003
    assert abs(high[0] - depth / 2) <= 1e-9


def test_masses_follow_from_the_solids() -> None:
    """A drawer by hand: five boards, a bar of 12 cm with round ends and two posts."""
    world = world_of({"procedural": "cabinet", "params": {"columns": [["drawer"]], "density": 500.0}})
    drawer = next(i for i, body in enumerate(world.bodies) if body.name == "it.drawer_1")
    boards = [g.shape.half_size for g in world.geoms if g.body == drawer and isinstance(g.shape, Box)]
    assert len(boards) == 5
    wood = 500.0 * sum(8 * x * y * z for x, y, z in boards)
    bar = pi * 0.008**2 * 0.12 + 4 / 3 * pi * 0.008**3
    posts = 2 * pi * (0.6 * 0.008) ** 2 * (0.04 - 0.008)
    assert world.bodies[drawer].inertial.mass == pytest.approx(wood + 2700.0 * (bar + posts), rel=1e-12)


def test_a_wheel_counts_no_mass_twice() -> None:
    """The capsules of the rim overlap at their ends; their mass is that of a ring, within 0.5 %."""
    world = world_of({"procedural": "valve", "params": {"spokes": 1, "density": 1000.0}})
    wheel = next(body for body in world.bodies if body.name == "it.wheel")
    hub = pi * 0.018**2 * 0.016
    reach = (0.08 - 0.016) - (0.018 + 0.008)
    spoke = pi * 0.008**2 * reach + 4 / 3 * pi * 0.008**3
    ring = 2 * pi * 0.08 * pi * 0.008**2
    assert wheel.inertial.mass == pytest.approx(1000.0 * (hub + spoke + ring), rel=5e-3)


@pytest.mark.parametrize("name", BUILDERS)
def test_every_builder_makes_a_sound_model(name: str) -> None:
    """Depth first, one joint a link, possible inertias, simple shapes, unique names, a place to hold or hold with."""
    model = build(name, {})
    root = BodyKind.STATIC if name == "camera_body" else BodyKind.FREE
    assert [body.kind for body in model.bodies] == [root, *[BodyKind.LINK] * len(model.joints)]
    assert [joint.body for joint in model.joints] == list(range(1, len(model.bodies)))
    for body in model.bodies[root is BodyKind.STATIC :]:
        assert body.inertial.mass > 0
        moments = np.linalg.eigvalsh(inertia.tensor(body.inertial))
        assert moments[0] > 0
        assert moments[2] <= moments[0] + moments[1]
    assert {type(geom.shape) for geom in model.geoms} <= {Box, Sphere, Cylinder, Capsule}
    for things in (model.bodies, model.joints, model.geoms, model.sites):
        names = [thing.name for thing in things]
        assert len(set(names)) == len(names)
    held = (".handle", "tcp", "top", "lens", "head", "mouth", "inside", "grip", "bar", "first", "cap", "well_1")
    assert any(site.name.endswith(held) for site in model.sites)
    assert build(name, {}) == model


@pytest.mark.parametrize("name", BUILDERS)
def test_the_page_lists_the_parameters_of_every_builder(name: str) -> None:
    page = (Path(__file__).parents[3] / "docs" / "concepts" / "articulations.md").read_text()
    section = page.split(f"### `{name}`")[1].split("\n#")[0]
    missing = [parameter for parameter in parameters(registry.load("assets", name)) if f"`{parameter}`" not in section]
    assert missing == []


def test_drawers_and_doors_are_numbered_and_open_forward() -> None:
    world = world_of({"procedural": "cabinet", "params": CABINETS["wide"]})
    assert [joint.name for joint in world.joints] == [
        f"it.{n}" for n in ("drawer_1", "drawer_2", "door_1", "door_2", "door_3")
    ]
    assert [s.name for s in world.sites if "shelf" in s.name] == [f"it.shelf_{i}" for i in (1, 2, 3, 4)]
    opened = np.array([[joint.upper for joint in world.joints]])
    poses = forward_kinematics(world, world.initial_body_pose[None], opened)[0]
    for body in range(1, len(world.bodies)):
        centre = shape_bounds(Sphere(0.0), _centre(world, poses, body), {})[0]
        assert centre[0] > _centre(world, world.initial_body_pose, body)[0] + 0.1
    drawers = [i for i, joint in enumerate(world.joints) if joint.type is JointType.PRISMATIC]
    heights = [world.bodies[world.joints[i].body].position[2] for i in drawers]
    assert all(above > below for above, below in pairwise(heights))


def test_doors_are_hinged_on_the_outer_side_unless_the_file_says() -> None:
    for hinge, sign in (("auto", 1.0), ("left", -1.0)):
        columns = [["drawer"], [{"front": "door", "hinge": hinge}]]
        world = world_of({"procedural": "cabinet", "params": {"columns": columns}})
        door = world.joints[-1]
        assert door.axis == (0.0, 0.0, sign)
        assert world.bodies[door.body].position[1] == pytest.approx(0.3 - 0.0015 if sign > 0 else 0.0015)


def test_scale_is_that_of_a_solid() -> None:
    small, large = build("cabinet", {}), build("cabinet", {}, scale=2.0)
    assert isinstance(small.geoms[0].shape, Box)
    assert large.joints[0].upper == 2 * small.joints[0].upper
    assert large.joints[-1].upper == small.joints[-1].upper
    assert large.bodies[1].inertial.mass == pytest.approx(8 * small.bodies[1].inertial.mass)
    assert np.allclose(large.bodies[1].inertial.inertia, 32 * np.array(small.bodies[1].inertial.inertia))
    assert np.allclose(large.sites[0].position, 2 * np.array(small.sites[0].position))
    for one, other in zip(small.geoms, large.geoms, strict=True):
        assert inertia.volume(other.shape, {}) == pytest.approx(8 * inertia.volume(one.shape, {}))


# ---------------------------------------------------------------------- what a file may ask


def test_a_uri_is_a_builder_with_its_defaults() -> None:
    as_text, as_asset = world_of("procedural:valve"), world_of({"asset": "procedural:valve"})
    assert as_text.bodies == as_asset.bodies == world_of({"procedural": "valve"}).bodies
    assert as_text.entities[0].source == as_asset.entities[0].source == "procedural:valve"
    assert import_asset("procedural:valve").joints[0].lower == -inf


def test_the_object_has_the_last_word() -> None:
    world = world_of("procedural:hinge_box", mass=3.0, color="red", friction=0.3, label="chest")
    assert sum(body.inertial.mass for body in world.bodies) == pytest.approx(3.0)
    own = [geom for geom in world.geoms if geom.body >= 0]
    assert {geom.color for geom in own} == {(1.0, 0.0, 0.0, 1.0)}
    assert {geom.surface.friction for geom in own} == {0.3}
    assert world.entities[0].label == "chest"


def test_what_does_not_fit_is_said_with_its_key() -> None:
    def cabinet(**params: Any) -> str:
        [text] = complaints(source={"procedural": "cabinet", "params": params})
        return text

    assert cabinet(widths=[1, 2, 3]) == "objects.it.source.params.widths: 2 columns need 2 widths, got 3"
    assert cabinet(gap=1e-4).startswith("objects.it.source.params.gap: door_1 is 0.2999 m wide and 0.018 m thick")
    assert "needs at least one column" in cabinet(columns=[])
    assert "the handle of drawer_1 is" in cabinet(handle={"length": 0.4})
    assert "needs a larger standoff" in cabinet(handle={"standoff": 0.005})
    assert "no room" in cabinet(size=[0.45, 0.6, 0.05])
    assert "no room between its back and its fronts" in cabinet(size=[0.05, 0.6, 0.7])
    assert "no room inside" in cabinet(columns=[[{"front": "open", "height": 0.001}, "open"]])
    [text] = complaints(source={"procedural": "valve", "params": {"limits": [1.0, 0.0]}})
    assert text == "objects.it.source.params.limits: the lower limit 1 is not below the upper one 0"
    [text] = complaints(source={"procedural": "hinge_box", "params": {"wall": 0.2}})
    assert "leave nothing of the size" in text
    [text] = complaints(source="procedural:valve", density=300.0)
    assert text.startswith("objects.it.density: a procedural asset has its own masses; give `mass`")


def test_faults_of_a_file_have_line_and_column(tmp_path: Path) -> None:
    file = tmp_path / "w.yaml"
    file.write_text("""\
world:
  objects:
    a: {source: {procedural: cabinett}}
    b:
      source:
        procedural: cabinet
        params: {colums: [[drawer]], wall: -1, columns: [[drawr]], handle: {stile: bar}}
    c: {source: {box: [1, 1, 1], params: {wall: 1}}}
    d: {source: procedural:cabinet, joints: {drawer_1: {initial: 0.1, opened: 0.5}, drawer_2: {limits: [1, 0]}}}
""")
    with pytest.raises(SpecError) as caught:
        api.load(file)
    found = [str(issue).removeprefix(str(file)) for issue in caught.value.issues]
    expected = [
        ":3:30: world.objects.a.source.procedural: no asset named 'cabinett' is installed; did you mean 'cabinet'?",
        ":7:18: world.objects.b.source.params.colums: unknown key; did you mean 'columns'?",
        ":7:44: world.objects.b.source.params.wall: ",
        ":7:59: world.objects.b.source.params.columns.0.0: expected one of drawer, door, double_door, open, panel; got",
        ":7:77: world.objects.b.source.params.handle.stile: unknown key; did you mean 'style'?",
        ":8:42: world.objects.c.source.params: `params` are for the builder that `procedural` names",
        ":9:79: world.objects.d.joints.drawer_1.opened: give either initial or opened, not both",
        ":9:104: world.objects.d.joints.drawer_2.limits: the lower limit 1 is not below the upper one 0",
    ]
    assert len(found) == len(expected), "\n".join(found)
    for text, start in zip(found, expected, strict=True):
        assert text.startswith(start), f"{text}\n{start}"


def test_a_fault_that_only_the_builder_sees_has_line_and_column_too(tmp_path: Path) -> None:
    file = tmp_path / "w.yaml"
    file.write_text("world:\n  objects:\n    a: {source: {procedural: cabinet, params: {gap: 0.0001}}}\n")
    with pytest.raises(SpecError, match=r"w\.yaml:3:53: world\.objects\.a\.source\.params\.gap: door_1"):
        api.compile_world(api.load(file))


# ---------------------------------------------------------------------- builders of other people


STAND = """
from anysim.kinematics import inertia
from anysim.assets.model import ImportedModel
from anysim.model.world import Body, BodyKind, Box, Geom


def stand(*, height: float = 0.5, weight: float) -> ImportedModel:
    \"\"\"A block.\"\"\"
    solid = Box((0.1, 0.1, height / 2))
    body = Body("stand", BodyKind.FREE, inertial=inertia.of_shape(solid, weight, {}))
    return ImportedModel("stand", (body,), geoms=(Geom("block", 0, solid),))


def odd() -> int:
    return 3
"""


@pytest.fixture
def stranger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An installed distribution with two entry points of the group `anysim.assets`."""
    (tmp_path / "stranger_assets.py").write_text(STAND)
    info = tmp_path / "stranger-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[anysim.assets]\nstand = stranger_assets:stand\nodd = stranger_assets:odd\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    registry.refresh()
    yield
    monkeypatch.undo()
    registry.refresh()


@pytest.mark.usefixtures("stranger")
def test_a_stranger_adds_a_builder() -> None:
    """A function with keyword-only parameters, and one entry point."""
    assert "stand" in registry.names("assets")
    world = world_of({"procedural": "stand", "params": {"weight": 2.0}, "scale": 2.0})
    assert [geom.shape for geom in world.geoms if geom.body == 0] == [Box((0.2, 0.2, 0.5))]
    assert world.bodies[0].inertial.mass == 16.0
    [text] = complaints(source={"procedural": "stand", "params": {"weight": "much"}})
    assert text.startswith("objects.it.source.params.weight: ")
    with pytest.raises(PluginError, match=r"the builder 'odd' of stranger returned a int"):
        build("odd", {})
    with pytest.raises(AssetError, match=r"'procedural:stand' needs parameters .*weight.*`procedural: stand`"):
        import_asset("procedural:stand")


# ---------------------------------------------------------------------- joints


def test_what_a_world_says_about_joints() -> None:
    world = world_of(
        "procedural:cabinet",
        joints={
            "drawer_2": {"opened": 0.5},
            "*": {"friction": 1.0},
            "drawer_*": {"friction": 4.0, "initial": 0.01},
            "door_1": {"limits": [0.0, 2.0], "initial": {"range": [0.2, 0.6]}, "damping": {"choice": [0.5, 1.0]}},
        },
    )
    by_name = {joint.name.removeprefix("it."): joint for joint in world.joints}
    assert [by_name[f"drawer_{i}"].initial for i in (1, 3)] == [0.01, 0.01]
    assert by_name["drawer_2"].initial == 0.5 * by_name["drawer_2"].upper
    assert [joint.friction for joint in by_name.values()] == [4.0, 4.0, 4.0, 1.0]
    door = by_name["door_1"]
    assert (door.initial, door.damping, door.upper) == (0.4, 0.5, 2.0)


def test_faults_of_joints_have_their_keys() -> None:
    texts = complaints(
        source="procedural:cabinet",
        joints={
            "drawer_9": {"friction": 1.0},
            "dor*": {"friction": 1.0},
            "drawer_1": {"initial": {"range": [0.0, 9.0]}},
            "door_1": {"initial": -0.1},
        },
    )
    starts = [
        "objects.it.joints.drawer_9: there is no joint 'drawer_9'; did you mean 'drawer_3'?",
        "objects.it.joints.dor*: there is no joint 'dor*'",
        "objects.it.joints.drawer_1.initial: 9 is outside of the limits [0, 0.3",
        "objects.it.joints.door_1.initial: -0.1 is outside of the limits [0, 1.57",
    ]
    assert len(texts) == len(starts)
    for text, start in zip(texts, starts, strict=True):
        assert text.startswith(start), text
    [text] = complaints(source="procedural:valve", joints={"wheel": {"opened": 0.5}})
    assert "'wheel' has no limits to take a share of" in text
    [text] = complaints(source={"box": [1, 1, 1]}, joints={"lid": {"opened": 0.5}})
    assert text.startswith("objects.it.joints.lid: there is no joint 'lid' (joints: none)")


def _bounds(world: World, geoms: list[Geom]) -> tuple[Any, Any]:
    """Corners (G, 3) of geoms whose bodies are parallel to the world, closed."""
    poses = world.initial_body_pose
    places = np.array([[*(poses[g.body][:3] + g.position), *g.quaternion] for g in geoms])
    ends = [shape_bounds(g.shape, place, {}) for g, place in zip(geoms, places, strict=True)]
    return np.array([low for low, _ in ends]), np.array([high for _, high in ends])


def _centre(world: World, poses: Any, body: int) -> Any:
    """The pose (7,) of a body's centre of mass."""
    from anysim.math import pose as P

    return P.compose(poses[body], np.array([*world.bodies[body].inertial.com, 0.0, 0.0, 0.0, 1.0]))
