"""Collision geometry of meshes: volumes, caches, notes and refusals."""

import shutil
import sys
from importlib import util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim.api import load
from anysim.assets.load import import_asset
from anysim.compile.world import compile_world
from anysim.engine.factory import create_simulation
from anysim.errors import AnysimError, AssetError, SpecError
from anysim.kinematics import inertia
from anysim.model.world import Box, Capsule, Cylinder, Geom, Mesh, MeshShape, Sphere, World
from anysim.testing.audit import audit
from anysim_colliders.balls import least_ball
from anysim_colliders.decompose import pieces
from anysim_colliders.primitives import primitive
from anysim_robots.drafting.draft import draft
from anysim_schemas.robot_model import RobotModelSpec
from anysim_schemas.run import WorldSpec
from tests.plugins.colliders.shapes import DRUM_VOLUME, HEIGHT, L_HULL, L_VOLUME, RADIUS, drum, l_part


def world_of(folder: Path, collision: Any = None, file: str = "l.obj", **more: Any) -> World:
    """A world with one object of a file."""
    source: dict[str, Any] = {"asset" if file.endswith((".urdf", ".xml", ".sdf")) else "mesh": file}
    source |= {} if collision is None else {"collision": collision}
    return compile_world(WorldSpec.model_validate({"objects": {"part": {"source": source, **more}}}), base=folder)


def volume_of(world: World) -> float:
    """[m^3] of all that collides."""
    meshes = {mesh.name: mesh for mesh in world.meshes}
    return sum(inertia.volume(geom.shape, meshes) for geom in own(world))


def own(world: World) -> list[Geom]:
    """What collides of its objects."""
    return [geom for geom in world.geoms if geom.collides and geom.body >= 0]


def told(world: World) -> str:
    """The notes of a world."""
    return " ".join(text for _, text in world.notes)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with an L and a drum."""
    l_part(tmp_path)
    drum(tmp_path)
    return tmp_path


def test_a_hull_that_fills_a_notch_is_told(folder: Path) -> None:
    """Without a choice and with `hull`: the same world, and a note with the share that the hull adds."""
    world = world_of(folder)
    assert volume_of(world) == pytest.approx(L_HULL, rel=1e-9)
    assert world.hash == world_of(folder, "hull").hash
    share = L_HULL / L_VOLUME - 1
    assert f"hull +{share:.0%}" in told(world)
    assert "decompose" in told(world)
    assert "convex" not in told(world_of(folder, file="drum.obj"))


def test_pieces_have_the_volume_of_the_part(folder: Path) -> None:
    world = world_of(folder, "decompose", density=500.0)
    assert volume_of(world) == pytest.approx(L_VOLUME, rel=5e-3)
    assert len(own(world)) == 2
    assert world.bodies[0].inertial.mass == pytest.approx(500.0 * L_VOLUME, rel=1e-9)  # of the part, not of its pieces
    assert "2 convex pieces: volume +0." in told(world)
    assert f"its hull {L_HULL / L_VOLUME - 1:+.1%}" in told(world)
    one = world_of(folder, {"method": "decompose", "pieces": 1})
    assert volume_of(one) == pytest.approx(L_HULL, rel=5e-3)


def test_pieces_are_cached_and_equal_in_every_bit(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the number of threads; a second time nothing is computed."""
    corners, faces = _triangles(folder / "l.obj")
    part = Mesh("part", corners, faces, "an L")
    monkeypatch.setenv("ANYSIM_CACHE_DIR", str(folder / "cache"))
    first = pieces(part, 0.05, 32, threads=1)
    (entry,) = (folder / "cache" / "colliders").iterdir()
    written = entry.stat().st_mtime_ns
    monkeypatch.setattr(sys, "executable", "/nowhere")  # so that nothing can be computed
    assert _bits(pieces(part, 0.05, 32)) == _bits(first)
    assert entry.stat().st_mtime_ns == written
    with pytest.raises(OSError, match="nowhere"):
        pieces(part, 0.06, 32)  # another parameter is another entry
    monkeypatch.undo()
    monkeypatch.setenv("ANYSIM_CACHE_DIR", str(folder / "other"))
    assert _bits(pieces(part, 0.05, 32, threads=3)) == _bits(first)


def _bits(meshes: tuple[Mesh, ...]) -> list[tuple[bytes, bytes, str]]:
    return [(mesh.vertices.tobytes(), mesh.faces.tobytes(), mesh.hash) for mesh in meshes]


def _triangles(file: Path) -> tuple[np.ndarray, np.ndarray]:
    lines = [line.split() for line in file.read_text().splitlines()]
    corners = np.array([[float(v) for v in row[1:]] for row in lines if row[0] == "v"])
    return corners, np.array([[int(v) - 1 for v in row[1:]] for row in lines if row[0] == "f"], dtype=np.int32)


def test_without_coacd_there_is_one_sentence(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = util.find_spec
    monkeypatch.setattr(util, "find_spec", lambda name, *more: None if name == "coacd" else found(name, *more))
    with pytest.raises(AssetError, match=r"needs the package coacd: pip install 'anysim-colliders\[coacd\]'"):
        world_of(folder, "decompose")


def test_a_mesh_that_coacd_cannot_take_is_refused_in_a_sentence(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    part = Mesh("part", *_triangles(folder / "l.obj"), "another L")
    with pytest.raises(AssetError, match="mesh 'part' cannot be decomposed by CoACD: it ended with 1"):
        pieces(part, 0.05, 7)


def test_the_best_primitive_is_found(folder: Path) -> None:
    world = world_of(folder, "primitives", file="drum.obj")
    (shape,) = (geom.shape for geom in own(world))
    assert isinstance(shape, Cylinder)
    assert (shape.radius, shape.half_length) == pytest.approx((RADIUS, HEIGHT / 2), rel=1e-9)
    more = volume_of(world) / DRUM_VOLUME - 1
    assert f"collides as a cylinder: volume {more:+.1%}" in told(world)
    assert world.bodies[0].inertial.mass == pytest.approx(1000.0 * DRUM_VOLUME, rel=1e-9)


@pytest.mark.parametrize("kind", [Box, Sphere, Cylinder, Capsule])
def test_a_primitive_is_found_again_wherever_it_lies(kind: type) -> None:
    """Its points, turned and shifted: the same kind, no point outside, and the sizes within the tessellation."""
    from scipy.spatial.transform import Rotation

    from anysim.geometry.triangles import convex_hull, triangles

    shape: Any = {
        Box: Box((0.02, 0.03, 0.05)),
        Sphere: Sphere(0.04),
        Cylinder: Cylinder(0.03, 0.05),
        Capsule: Capsule(0.03, 0.05),
    }[kind]
    drawn = triangles(shape)
    assert drawn is not None
    turn = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix()
    points = drawn[0] @ turn.T + [0.2, -0.1, 0.3]
    hull = Mesh("hull", *convex_hull(points, 64), "points")
    found = primitive(points, hull)
    assert isinstance(found.shape, kind)
    assert inertia.volume(found.shape, {}) == pytest.approx(inertia.volume(shape, {}), rel=0.02)
    assert np.asarray(found.position) == pytest.approx([0.2, -0.1, 0.3], abs=1e-3)


def test_the_least_circle_and_ball() -> None:
    """Around corners of a square and a cube, which are known, and around random points, none is outside."""
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [1.0, 1.5]])
    assert least_ball(square)[1] == pytest.approx(np.sqrt(2.0))
    line = np.array([[0.0, 0.0], [1.0, 1.0], [3.0, 3.0], [2.0, 2.0]])
    assert least_ball(line)[1] == pytest.approx(1.5 * np.sqrt(2.0))
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    assert least_ball(cube)[1] == pytest.approx(np.sqrt(0.75))
    rng = np.random.default_rng(3)
    for _ in range(20):
        points = rng.normal(size=(40, 2))
        centre, radius = least_ball(points)
        away = np.linalg.norm(points - centre, axis=1)
        assert away.max() == pytest.approx(radius)
        touching = points[away > radius * (1 - 1e-9)]
        assert len(touching) >= 2  # else there is a smaller one
        directions = touching - centre
        assert all((directions @ d).min() <= 1e-9 for d in directions)  # not all on one side


def test_triangles_are_refused_where_something_moves(folder: Path) -> None:
    with pytest.raises(
        AssetError, match=r"`collision: mesh` is for what is fixed; set `fixed: true`, or say `decompose`"
    ):
        world_of(folder, "mesh")
    (folder / "door.urdf").write_text(_DOOR)
    with pytest.raises(AssetError, match="its links leaf move; say `decompose`"):
        world_of(folder, "mesh", "door.urdf", fixed=True)
    for source, match in (
        ({"box": [0.1, 0.1, 0.1], "collision": "hull"}, r"collision: `collision` is for meshes"),
        ({"mesh": "l.obj", "collision": {"method": "hull", "pieces": 3}}, "`pieces` is for `method: decompose`"),
    ):
        with pytest.raises(SpecError, match=match):
            load({"world": {"objects": {"b": {"source": source}}}})


_LINK = """<link name="{name}"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0"
  izz="0.01"/></inertial><collision><geometry><mesh filename="{file}"/></geometry></collision></link>"""
_DOOR = f"""<robot name="door">{_LINK.format(name="frame", file="l.obj")}{_LINK.format(name="leaf", file="drum.obj")}
<joint name="hinge" type="revolute"><parent link="frame"/><child link="leaf"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="10" velocity="1"/></joint></robot>"""
_MJCF = """<mujoco><asset><mesh name="l" file="l.obj"/></asset><worldbody><body name="part">
<geom type="mesh" mesh="l" density="500"/></body></worldbody></mujoco>"""
_SDF = """<sdf version="1.9"><model name="part"><link name="l"><collision name="c"><geometry><mesh>
<uri>l.obj</uri></mesh></geometry></collision></link></model></sdf>"""


def test_a_draft_of_a_robot_tells_of_its_hulls(folder: Path) -> None:
    (folder / "door.urdf").write_text(_DOOR)
    assert any("convex hulls with over 10% more volume" in note for note in draft(folder / "door.urdf").notes)


@pytest.mark.parametrize(("file", "text"), [("door.urdf", _DOOR), ("part.xml", _MJCF), ("part.sdf", _SDF)])
def test_meshes_of_files_are_decomposed_too(folder: Path, file: str, text: str) -> None:
    """Of URDF, MJCF and SDF: masses stay, the hull is gone, and what is there without a choice tells of it."""
    (folder / file).write_text(text)
    before, world = world_of(folder, file=file), world_of(folder, "decompose", file)
    drums = DRUM_VOLUME if file == "door.urdf" else 0.0
    assert volume_of(before) - drums == pytest.approx(L_HULL, rel=1e-4)
    assert volume_of(world) - drums == pytest.approx(L_VOLUME, rel=5e-3)
    assert "convex hulls with over 10% more volume" in told(before)
    assert "convex pieces: volume" in told(world)
    assert [body.inertial for body in before.bodies] == [body.inertial for body in world.bodies]
    wholes = import_asset(str(folder / file)).wholes
    assert min(whole.volume for whole in wholes.values()) == pytest.approx(L_VOLUME, rel=1e-4)


def test_open_triangles_have_no_volume(tmp_path: Path) -> None:
    drum(tmp_path, closed=False)
    assert "are not closed, so what they enclose is not known" in told(world_of(tmp_path, "primitives", "drum.obj"))
    assert told(world_of(tmp_path, file="drum.obj")) == ""


def test_a_mesh_that_faces_inward_has_its_mass(tmp_path: Path) -> None:
    """And is told as any other."""
    file = l_part(tmp_path)
    turned = [f"f {c} {b} {a}" for a, b, c in (_triangles(file)[1] + 1).tolist()]
    corners = [line for line in file.read_text().splitlines() if line[0] == "v"]
    file.write_text("\n".join([*corners, *turned]))
    world = world_of(tmp_path, "primitives")
    assert world.bodies[0].inertial.mass == pytest.approx(1000.0 * L_VOLUME)
    assert "its hull +88.9%" in told(world)


def test_links_that_the_entry_replaces_are_left_alone() -> None:
    spec = {"name": "r", "description": "d", "source": "r.urdf", "license": "MIT", "license_source": "x"}
    more = {"category": "arm", "channels": {}, "collision_shapes": "mesh"}
    with pytest.raises(ValueError, match="triangles are for what is fixed, and a robot's links move"):
        RobotModelSpec.model_validate(spec | more)


# ------------------------------------------------------------------ on engines


def notch(folder: Path, collision: str) -> World:
    """The L on its floor with its notch up, and a ball above the notch."""
    part = {"source": {"mesh": "l.obj", "collision": collision}, "fixed": collision != "decompose", "friction": 0.6}
    ball = {"source": {"sphere": 0.01}, "mass": 0.01}
    layout = {"part": {"position": [0.0, 0.0, 0.0], "roll": np.pi / 2}, "ball": {"position": [0.06, -0.02, 0.12]}}
    layout = {name: {**place, "checked": False} for name, place in layout.items()}
    spec = {"terrain": "plane", "objects": {"part": part, "ball": ball}, "layout": layout}
    return compile_world(WorldSpec.model_validate(spec), base=folder)


def rests_in_the_notch(world: World, engine: str) -> bool:
    """Whether the ball lies on the floor of the L after a second."""
    with create_simulation(engine) as simulation:
        simulation.create_world(world, 1)
        simulation.reset()
        simulation.step(round(1.0 / world.physics.dt))
        x, _, z = simulation.get_state().body_pose[0, world.entity_numbers["ball"], :3]
        return bool(0.02 < x < 0.1 and abs(z - 0.03) < 3e-3)


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_a_ball_rests_in_the_notch_of_pieces_and_not_of_a_hull(folder: Path, engine: str) -> None:
    """And what the engine has built is what the world says."""
    pieces_world = notch(folder, "decompose")
    assert rests_in_the_notch(pieces_world, engine)
    assert not rests_in_the_notch(notch(folder, "hull"), engine)
    with create_simulation(engine) as simulation:
        simulation.create_world(pieces_world, 1)
        assert [line for line in audit(simulation) if line.ok is False] == []


@pytest.mark.parametrize("engine", ["pybullet", "sapien"])
def test_a_ball_rests_in_the_notch_of_triangles(folder: Path, engine: str) -> None:
    assert rests_in_the_notch(notch(folder, "mesh"), engine)


def test_mujoco_refuses_triangles_by_name(folder: Path) -> None:
    world = notch(folder, "mesh")
    with create_simulation("mujoco") as simulation, pytest.raises(AnysimError, match=r"triangle mesh.*decompose"):
        simulation.create_world(world, 1)


def test_others_take_triangles_of_a_thing_for_its_hull(folder: Path) -> None:
    """So that nothing is placed inside: the thing has a size, and is no ground."""
    from anysim.geometry.bounds import EntityShape

    shape = EntityShape(notch(folder, "mesh"), "part")
    assert shape.collides
    low, high = shape.bounds(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
    assert (high - low).tolist() == pytest.approx([0.1, 0.1, 0.04])
    assert all(isinstance(one.shape, MeshShape) for one in shape.shapes)
