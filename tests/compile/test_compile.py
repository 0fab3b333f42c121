"""Compiling worlds: entities, values, layout, cameras, sensors, terrain, and the hash."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from anysim.compile.world import compile_with_report, compile_world
from anysim.conventions import WORLD
from anysim.math import pose as P
from anysim.model.world import BodyKind, Box, Capsule, Cylinder, HeightFieldShape, MeshShape, Plane, World
from anysim_schemas.run import RunSpec, WorldSpec

Make = Callable[..., World]
CUBE = {"source": {"box": [0.04, 0.04, 0.04]}}
TABLE = {"source": {"box": [0.8, 1.2, 0.04]}, "fixed": True}


def body(world: World, name: str) -> int:
    return next(i for i, b in enumerate(world.bodies) if b.name == name)


def test_nominal_values_stand_for_drawn_ones(world: Make) -> None:
    made = world(
        objects={
            "a": {
                **CUBE,
                "mass": {"range": [0.05, 0.2]},
                "color": {"choice": ["lime", "red"]},
                "friction": {"range": [0.4, 0.8]},
            },
            "b": {**CUBE, "density": {"choice": [500, 1000]}, "color": {"range": [[0, 0, 0], [1, 1, 0]]}},
            "c": {**CUBE, "mass": {"normal": {"mean": 0.5, "std": 0.1, "high": 0.4}}},
            "d": CUBE,
        }
    )
    a, b, c, d = (made.bodies[body(made, name)].inertial for name in "abcd")
    assert a.mass == pytest.approx(0.125)
    assert a.inertia[0] == pytest.approx(0.125 * 0.04**2 / 6)
    assert b.mass == pytest.approx(0.032)
    assert c.mass == pytest.approx(0.4)
    assert d.mass == pytest.approx(0.064)
    geoms = {g.name: g for g in made.geoms}
    assert geoms["a.shape"].color == (0, 1, 0, 1)
    assert geoms["a.shape"].surface.friction == pytest.approx(0.6)
    assert geoms["b.shape"].color == (0.5, 0.5, 0, 1)


def test_primitives_and_kinds(world: Make) -> None:
    made = world(
        objects={
            "ball": {"source": {"sphere": 0.1}},
            "can": {"source": {"cylinder": [0.1, 0.4]}},
            "pill": {"source": {"capsule": [0.1, 0.4]}, "collides": False},
            "table": TABLE,
        }
    )
    shapes = {g.name: g for g in made.geoms}
    assert shapes["can.shape"].shape == Cylinder(0.1, 0.2)
    assert shapes["pill.shape"].shape == Capsule(0.1, 0.2)
    assert not shapes["pill.shape"].collides
    assert shapes["table.shape"].shape == Box((0.4, 0.6, 0.02))
    assert made.bodies[body(made, "table")].kind is BodyKind.STATIC
    assert made.bodies[body(made, "ball")].kind is BodyKind.FREE
    assert [e.name for e in made.entities] == ["ball", "can", "pill", "table"]
    assert [e.label for e in made.entities] == ["ball", "can", "pill", "table"]


def test_mesh_objects_collide_as_their_hull_and_weigh_like_it(world: Make, tmp_path: Path) -> None:
    trimesh.creation.box((0.1, 0.2, 0.3)).export(str(tmp_path / "brick.stl"))
    made = world(
        tmp_path,
        objects={
            "brick": {"source": "brick.stl", "color": "red"},
            "half": {"source": {"mesh": "brick.stl", "scale": 0.5}},
        },
    )
    hull, visual = (g for g in made.geoms if g.name.startswith("brick."))
    assert (hull.collides, hull.visible, visual.collides, visual.visible) == (True, False, False, True)
    assert visual.color == (1, 0, 0, 1)
    assert isinstance(hull.shape, MeshShape)
    assert made.bodies[0].inertial.mass == pytest.approx(6.0, rel=1e-6)
    assert made.bodies[0].inertial.inertia[0] == pytest.approx(6.0 * (0.2**2 + 0.3**2) / 12, rel=1e-6)
    assert made.bodies[1].inertial.mass == pytest.approx(0.75, rel=1e-6)
    assert made.entities[0].source == "brick.stl"  # as written: no path of this machine enters the hash


def test_asset_objects(world: Make, tmp_path: Path) -> None:
    box = '<geometry><box size="0.2 0.2 0.2"/></geometry>'
    inertial = '<inertial><mass value="2"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial>'
    (tmp_path / "box.urdf").write_text(
        f'<robot name="b"><link name="base">{inertial}<collision>{box}</collision></link>'
        f'<link name="lid">{inertial}<collision>{box}</collision></link><joint name="hinge" type="continuous">'
        '<origin xyz="0 0 0.2"/><parent link="base"/><child link="lid"/></joint></robot>'
    )
    made = world(
        tmp_path,
        objects={"a": {"source": "box.urdf"}, "b": {"source": "box.urdf", "fixed": True, "mass": 1, "friction": 0.3}},
        layout={"a": {"on": "terrain"}},
    )
    assert [b.name for b in made.bodies] == ["a.base", "a.lid", "b.base", "b.lid"]
    assert [b.kind for b in made.bodies] == [BodyKind.FREE, BodyKind.LINK, BodyKind.STATIC, BodyKind.LINK]
    assert [j.name for j in made.joints] == ["a.hinge", "b.hinge"]
    assert made.joints[1].body == 3
    assert made.bodies[2].inertial.mass == pytest.approx(0.5)
    assert made.bodies[2].inertial.inertia[0] == pytest.approx(0.025)
    assert {g.surface.friction for g in made.geoms if g.body in (2, 3)} == {0.3}
    assert made.bodies[0].position == (0, 0, 0.1)
    assert made.entities[1].joint_start == 1


def test_supports_are_resolved_in_any_order(world: Make) -> None:
    made = world(
        objects={"cube": CUBE, "tray": {"source": {"box": [0.2, 0.2, 0.02]}}, "table": TABLE},
        layout={
            "cube": {"on": "tray", "x": {"range": [0.4, 0.6]}, "y": 0.1, "yaw": 0.3},
            "tray": {"on": "table", "x": 0.5},
            "table": {"position": {"range": [[0.4, 0, 0.38], [0.6, 0, 0.38]]}},
        },
    )
    pose = {b.name: np.array([*b.position, *b.quaternion]) for b in made.bodies}
    np.testing.assert_allclose(pose["table"][:3], (0.5, 0, 0.38))
    np.testing.assert_allclose(pose["tray"][:3], (0.5, 0, 0.41))
    np.testing.assert_allclose(pose["cube"][:3], (0.5, 0.1, 0.44))
    np.testing.assert_allclose(pose["cube"][3:], P.from_roll_pitch_yaw(np.array([0, 0, 0.3])), atol=1e-12)


def test_a_tilted_object_touches_with_its_lowest_corner(world: Make) -> None:
    made = world(objects={"cube": CUBE}, layout={"cube": {"on": "terrain", "roll": np.pi / 4}})
    assert made.bodies[0].position[2] == pytest.approx(0.02 * np.sqrt(2))


def test_on_a_robot_and_without_layout(world: Make) -> None:
    made = world(
        robots={"p": {"robot": "franka_panda"}}, objects={"cube": CUBE, "wall": TABLE}, layout={"cube": {"on": "p"}}
    )
    assert made.bodies[body(made, "cube")].position[2] > 0.6
    alone = world(objects={"cube": CUBE, "wall": TABLE})
    assert alone.bodies[0].position == (0, 0, 0.02)  # set onto the ground
    assert alone.bodies[1].position == (0, 0, 0)  # fixed: its frame at the origin


def test_height_fields_carry_objects_on_the_highest_point_below(world: Make) -> None:
    heights = [[0.0] * 5, [0.0] * 5, [0.0, 0.0, 0.5, 0.0, 0.0], [0.0] * 5, [0.0] * 5]
    made = world(
        terrain={"kind": "heightfield", "heights": heights, "size": [4, 4]},
        objects={"slab": {"source": {"box": [1, 1, 0.2]}}, "pin": CUBE, "far": CUBE},
        layout={
            "slab": {"on": "terrain", "x": 0.2},
            "pin": {"on": "terrain", "x": 0.5},
            "far": {"on": "terrain", "x": 1.5},
        },
    )
    z = {b.name: b.position[2] for b in made.bodies}
    assert z["slab"] == pytest.approx(0.6)  # the peak at the origin is under it
    assert z["pin"] == pytest.approx(0.02 + 0.5 * 0.52)  # on the slope, at its corner nearest to the peak
    assert z["far"] == pytest.approx(0.02)
    (ground,) = (g for g in made.geoms if g.body == WORLD)
    assert ground.name == "terrain"
    assert isinstance(ground.shape, HeightFieldShape)
    assert made.heightfields[0].heights.shape == (5, 5)


def test_terrain(world: Make) -> None:
    assert isinstance(world().geoms[0].shape, Plane)
    assert world(terrain="none").geoms == ()
    assert world(terrain={"kind": "plane", "friction": 0.3}).geoms[0].surface.friction == 0.3


def test_cameras(world: Make) -> None:
    made = world(
        robots={"p": {"robot": "franka_panda"}},
        objects={"cube": CUBE},
        layout={"cube": {"position": [0.5, 0, 0.3]}},
        cameras={
            "front": {"from": [1.5, 0, 0.3], "look_at": "cube"},
            "top": {"from": [0, 0, 2], "look_at": [0, 0, 0], "size": [64, 48], "fov": 45, "channels": ["rgb", "depth"]},
            "wrist": {"mount": "p.tool", "position": [0.1, 0, -0.05]},
            "link": {"mount": "p.panda_link3"},
        },
    )
    front, top, wrist, on_link = made.cameras
    assert (front.body, front.look_at, top.look_at) == (WORLD, "cube", None)
    np.testing.assert_allclose(P.rotate(np.array(front.quaternion), np.array([0, 0, 1.0])), (-1, 0, 0), atol=1e-9)
    assert (top.width, top.height, top.fov, top.channels) == (64, 48, 45, ("rgb", "depth"))
    assert made.bodies[wrist.body].name == "p.panda_link7"
    mounted = P.compose(made.initial_body_pose[wrist.body], P.pose(wrist.position, wrist.quaternion))
    np.testing.assert_allclose(mounted[:3], (0.605, 0, 0.354), atol=1e-3)
    assert made.bodies[on_link.body].name == "p.panda_link3"


def test_contact_sensors_and_lights(world: Make) -> None:
    made = world(
        robots={"p": {"robot": "franka_panda"}},
        objects={"cube": CUBE},
        contact_sensors={
            "hand": {"body": "p.panda_hand_tcp", "against": "cube"},
            "all": {"body": "p"},
            "floor": {"body": "cube", "against": "terrain"},
        },
        lights={"sun": {"direction": [0, 0, -2]}},
    )
    hand, everything, floor = made.contact_sensors
    assert hand.bodies == (7,)  # the hand is lumped into link 7
    assert hand.against == (10,)
    assert everything.bodies == tuple(range(10))
    assert everything.against is None
    assert floor.against == (WORLD,)
    assert made.lights[0].direction == (0, 0, -1)
    assert len(world().lights) == 2


def test_robots_stand_where_the_spec_says(world: Make) -> None:
    made = world(
        robots={
            "left": {
                "robot": "franka_panda",
                "position": [0, 0.5, 0.1],
                "yaw": np.pi / 2,
                "home": {"panda_joint1": 0.5},
            },
            "right": {"robot": "franka_panda"},
        }
    )
    assert made.bodies[0].position == (0, 0.5, 0.1)
    np.testing.assert_allclose(made.bodies[0].quaternion, (0, 0, np.sqrt(0.5), np.sqrt(0.5)), atol=1e-12)
    assert made.joints[0].initial == 0.5
    assert made.joints[9].initial == 0
    _, right = made.robots
    assert right.channels["arm"].joints == tuple(range(9, 16))
    assert right.channels["arm"].actuators == tuple(range(9, 16))
    assert made.joints[17].mimic is not None
    assert made.joints[17].mimic.joint == 16
    assert made.sites[right.tools["tool"]].name == "right.tool"
    assert len({m.name for m in made.meshes}) == len(made.meshes)
    assert len(made.meshes) == len(world(robots={"one": {"robot": "franka_panda"}}).meshes)  # shared, not copied
    assert all((a < 10) == (b < 10) for a, b in made.excluded_pairs)


def test_contact_presets(world: Make) -> None:
    made = world(
        objects={
            "pad": {**CUBE, "contact": {"preset": "pad"}},
            "soft": {**CUBE, "contact": {"preset": "soft"}},
            "own": {**CUBE, "contact": {"preset": "pad", "priority": 3, "torsional_friction": 0.01}},
            "plain": CUBE,
        }
    )
    pad, soft, own, plain = (g.surface for g in made.geoms if g.body >= 0)
    assert (pad.softness, pad.impedance, pad.priority, pad.torsional) == (0.004, (0.99, 0.999), 1, True)
    assert soft.softness > 0.02
    assert (own.priority, own.torsional_friction, own.softness) == (3, 0.01, 0.004)
    assert (plain.softness, plain.priority, plain.torsional) == (0.0, 0, False)


def test_physics_of_the_run(world: Make) -> None:
    run = RunSpec.model_validate({"physics": {"dt": 0.001, "control_dt": 0.01, "gravity": [0, 0, -1.6]}})
    physics = compile_world(run).physics
    assert (physics.dt, physics.substeps, physics.gravity) == (0.001, 10, (0, 0, -1.6))


def test_the_report_says_what_importers_did(tmp_path: Path) -> None:
    (tmp_path / "a.urdf").write_text(
        '<robot name="a"><link name="b"><inertial><mass value="1"/></inertial>'
        '<visual><geometry><sphere radius="0.1"/></geometry></visual></link></robot>'
    )
    spec = WorldSpec.model_validate({"objects": {"thing": {"source": "a.urdf"}}})
    report = compile_with_report(spec, base=tmp_path).report
    assert any("no collision geometry" in note.message for note in report["thing"])
    assert any("no inertia" in note.message for note in report["thing"])


HASH = """
import json, sys
from pathlib import Path
from anysim.compile.world import compile_world
from anysim_schemas.run import WorldSpec
print(compile_world(WorldSpec.model_validate(json.loads(sys.argv[2])), base=Path(sys.argv[1])).hash)
"""


def hash_in_a_process(base: Path, spec: dict[str, object], seed: int, cache: Path | None = None) -> str:
    env = {**os.environ, "PYTHONHASHSEED": str(seed)} | ({"ANYSIM_CACHE_DIR": str(cache)} if cache else {})
    command = [sys.executable, "-c", HASH, str(base), json.dumps(spec)]
    run = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


def test_the_hash_does_not_depend_on_the_cache_or_on_the_place(tmp_path: Path) -> None:
    trimesh.creation.icosphere(3, 0.1).export(str(tmp_path / "brick.stl"))
    spec: dict[str, object] = {"objects": {"brick": {"source": "brick.stl"}}}
    found = [
        hash_in_a_process(tmp_path, spec, 1, tmp_path / "cold"),
        hash_in_a_process(tmp_path, spec, 2, tmp_path / "cold"),  # a hit
        hash_in_a_process(tmp_path, spec, 3, tmp_path / "brick.stl"),  # cannot be written
    ]
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "brick.stl").rename(tmp_path / "elsewhere" / "brick.stl")
    found.append(hash_in_a_process(tmp_path / "elsewhere", spec, 4, tmp_path / "cold"))
    assert len(set(found)) == 1, found


def test_the_hash_of_a_robot_is_the_same_in_every_process(tmp_path: Path) -> None:
    spec: dict[str, object] = {
        "robots": {"r": {"robot": "franka_panda"}}, "objects": {"cube": CUBE},
        "cameras": {"c": {"from": [1, 1, 1], "look_at": "cube"}}, "contact_sensors": {"s": {"body": "r"}},
    }  # fmt: skip
    here = compile_world(WorldSpec.model_validate(spec)).hash
    assert [hash_in_a_process(tmp_path, spec, seed) for seed in (1, 2)] == [here, here]
    other = {**spec, "objects": {"cube": {**CUBE, "mass": 0.1}}}
    assert compile_world(WorldSpec.model_validate(other)).hash != here


def test_importing_is_light() -> None:
    script = (
        "import sys\nimport anysim.compile.world, anysim.compile.edit, anysim.model.frames\n"
        "heavy = {'trimesh', 'yourdfpy', 'scipy', 'mujoco', 'lxml', 'collada', 'yaml'} & set(sys.modules)\n"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
