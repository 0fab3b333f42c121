"""Random scenes with contacts, and random things done to them; all of it made from numbers alone, in any process.

As a program it restores snapshots that another process took and prints digests of how the scenes go on:

    python random_scenes.py ENGINE STORED.npz
"""

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from anysim.compile.world import compile_world
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.engine.factory import create_simulation
from anysim.engine.parameters import PARAMETERS
from anysim.engine.state import FIELDS, Snapshot, SnapshotLevel
from anysim.geometry.triangles import convex_hull
from anysim.math import pose as P
from anysim.model.world import (
    Box,
    Capsule,
    ContactSensor,
    ControlMode,
    Cylinder,
    JointType,
    Mesh,
    MeshShape,
    Shape,
    Sphere,
    Surface,
    World,
)
from anysim.testing.sketch import Sketch, inertial
from anysim_schemas.run import WorldSpec

PANDA_EVERY = 10
"""Every how manyeth scene has the catalogue's Panda instead of a random arm."""

FURNITURE_EVERY = 10
"""Every how manyeth scene has a cabinet and a box with a lid, counted from the sixth."""

ENVS = 2

Rng = np.random.Generator


def scene(number: int) -> World:
    """Objects dropped in a heap around a robot, on the ground; or onto furniture."""
    rng = np.random.default_rng([number, 0])
    if number % FURNITURE_EVERY == FURNITURE_EVERY // 2:
        return _furniture(rng)
    return _panda_scene(rng) if number % PANDA_EVERY == 0 else _sketch(number, rng)


def _sketch(number: int, rng: Rng) -> World:
    s = Sketch(f"random{number}", dt=float(rng.choice([0.002, 0.004])))
    s.ground(_surface(rng))
    meshes: list[Mesh] = []
    if rng.random() < 0.8:
        _arm(s, rng)
    height = 0.0
    for i in range(int(rng.integers(2, 8))):
        shape, size = _shape(rng, meshes)
        height += size + 0.5 * size * rng.random()
        place = (*(0.3 + 0.05 * rng.standard_normal(2)).tolist(), height)
        mass = inertial(shape if not isinstance(shape, MeshShape) else Sphere(size), float(rng.uniform(0.1, 2.0)))
        body = s.free(f"thing{i}", shape, place, quaternion=_turn(rng), surface=_surface(rng), inertia=mass)
        for _ in range(int(rng.choice([0, 0, 0, 1, 2]))):
            further, extent = _shape(rng, meshes)
            s.shape(body, further, tuple((0.7 * size * _direction(rng)).tolist()), surface=_surface(rng))
            size = max(size, 0.7 * size + extent)
        height += size
        if rng.random() < 0.5:
            s.sensors.append(ContactSensor(f"thing{i}", (body,)))
    if rng.random() < 0.5:
        s.fixed("step", Box((0.1, 0.1, 0.02)), (0.3, 0.3, 0.02), surface=_surface(rng))
    s.more["meshes"] = tuple(meshes)
    return s.world()


def _surface(rng: Rng) -> Surface:
    return Surface(friction=float(rng.choice([0.2, 0.5, 0.8])), restitution=float(rng.choice([0.0, 0.0, 0.4])))


def _direction(rng: Rng) -> Array:
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _turn(rng: Rng) -> Any:
    return tuple(P.from_axis_angle(_direction(rng), np.array(rng.uniform(0, 3))).tolist())


def _shape(rng: Rng, meshes: list[Mesh]) -> tuple[Shape, float]:
    """A shape of a few centimetres, and how far it reaches from its middle."""
    a, b, c = (float(v) for v in rng.uniform(0.02, 0.06, 3))
    match int(rng.integers(5)):
        case 0:
            return Box((a, b, c)), float(np.linalg.norm([a, b, c]))
        case 1:
            return Sphere(a), a
        case 2:
            return Cylinder(a, b), float(np.hypot(a, b))
        case 3:
            return Capsule(a, b), a + b
        case _:
            points = a * np.array([_direction(rng) for _ in range(int(rng.integers(6, 16)))])
            vertices, faces = convex_hull(points - points.mean(axis=0), 32)
            name = f"hull{len(meshes)}"
            meshes.append(Mesh(name, vertices, faces.astype(np.int32), hashlib.sha256(vertices.tobytes()).hexdigest()))
            return MeshShape(name), 2 * a


def _arm(s: Sketch, rng: Rng) -> None:
    """One to four links that reach into the heap, some of several shapes, with drives of all modes."""
    parent = s.robot("arm", (0.0, 0.0, float(rng.uniform(0.05, 0.2))))
    axes = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    for i in range(int(rng.integers(1, 5))):
        sliding = rng.random() < 0.25
        rod = Box((0.08, 0.015, 0.015))
        motor: dict[str, Any] = {"damping": float(rng.uniform(0, 0.2)), "armature": float(rng.choice([0.0, 0.01]))}
        motor["friction"] = float(rng.choice([0.0, 0.0, 0.05]))
        reach = 0.1 if sliding else 2.0
        link = s.link(
            f"link{i}",
            parent,
            JointType.PRISMATIC if sliding else JointType.REVOLUTE,
            axes[int(rng.integers(3))],
            inertial(rod, 0.5, (0.08, 0.0, 0.0)),
            position=(0.16 if i else 0.0, 0.0, 0.0),
            lower=-reach,
            upper=reach,
            initial=float(rng.uniform(-0.3, 0.3)) * reach,
            **motor,
        )
        s.shape(link, rod, (0.08, 0.0, 0.0), surface=_surface(rng))
        if rng.random() < 0.5:
            s.shape(link, Sphere(0.03), (0.16, 0.0, 0.0), surface=_surface(rng))
        if rng.random() < 0.8:
            s.drive(link, rng.choice(list(ControlMode)), float(rng.uniform(10, 100)), float(rng.uniform(1, 8)), 30.0)
        parent = link


def _panda_scene(rng: Rng) -> World:
    sources = [{"box": [0.05, 0.05, 0.05]}, {"sphere": 0.03}, {"cylinder": [0.03, 0.04]}, {"capsule": [0.02, 0.05]}]
    objects = {
        f"thing{i}": {"source": sources[int(rng.integers(len(sources)))], "mass": float(rng.uniform(0.05, 0.3))}
        for i in range(3)
    }
    layout = {
        name: {"position": [*(np.array([0.45, 0.0]) + 0.02 * rng.standard_normal(2)).tolist(), 0.04 + 0.09 * i]}
        for i, name in enumerate(objects)
    }
    spec = {"robots": {"panda": {"robot": "franka_panda"}}, "objects": objects, "layout": layout}
    return compile_world(WorldSpec.model_validate(spec))


def _furniture(rng: Rng) -> World:
    """A cabinet, fixed or not, with drawers and doors ajar, a box with a lid on it, and things that fall into both."""
    fronts = ["drawer", "drawer", "door", "double_door", "open"]
    columns = [
        [str(rng.choice(fronts)) for _ in range(int(rng.integers(1, 4)))] for _ in range(int(rng.integers(1, 4)))
    ]
    columns[0][0] = "drawer"
    ajar = {"*": {"opened": float(rng.uniform(0.1, 0.6)), "friction": float(rng.choice([0.0, 0.5, 2.0]))}}
    cabinet = {"procedural": "cabinet", "params": {"size": [0.4, 0.4 * len(columns), 0.5], "columns": columns}}
    objects: dict[str, Any] = {
        "cabinet": {"source": cabinet, "fixed": bool(rng.random() < 0.5), "joints": ajar},
        "chest": {"source": "procedural:hinge_box", "joints": {"lid": {"opened": float(rng.uniform(0.3, 0.9))}}},
    }
    layout: dict[str, Any] = {"cabinet": {"position": [0, 0, 0]}, "chest": {"on": "cabinet", "x": 0, "y": 0}}
    sources = [{"box": [0.05, 0.05, 0.05]}, {"sphere": 0.03}, {"capsule": [0.02, 0.05]}]
    for i in range(3):
        objects[f"thing{i}"] = {"source": sources[int(rng.integers(3))], "mass": float(rng.uniform(0.05, 0.3))}
        place = np.array([0.0 if i else 0.25, 0.0]) + 0.05 * rng.standard_normal(2)
        layout[f"thing{i}"] = {"position": [*place.tolist(), 0.75 + 0.1 * i]}
    return compile_world(WorldSpec.model_validate({"objects": objects, "layout": layout}))


# ---------------------------------------------------------------------- what is done


def options(engine: str, number: int) -> dict[str, Any]:
    """Where an engine renews itself now and then, half of the scenes see it happen."""
    return {"rebase_steps": 17} if engine == "sapien" and number % 2 else {}


def build(engine: str, number: int, num_envs: int = ENVS) -> SimEngine:
    """A new engine with a scene."""
    return create_simulation(engine, **options(engine, number)).create_world(scene(number), num_envs)


def treat(engine: SimEngine, number: int, part: int, length: int, rows: list[int]) -> str:
    """Do random things to the envs in `rows`, whose kinds are 0, 1, …; the digest of all states on the way."""
    digest = hashlib.sha256()
    rng = np.random.default_rng([number, part])
    world = engine.world
    free = [i for i, b in enumerate(world.bodies) if b.kind == "free"]
    initial = np.array([world.joints[a.joint].initial for a in world.actuators])
    for _ in range(length):
        shape = (len(rows), len(world.actuators))
        engine.set_control(
            initial + 0.3 * rng.standard_normal(shape),
            rng.standard_normal(shape),
            2.0 * rng.standard_normal(shape),
            rows,
        )
        if shape[1] and rng.random() < 0.1:
            engine.set_control_mode(rng.choice(list(ControlMode)), [rows[0]], [int(rng.integers(shape[1]))])
        if Capability.WRENCHES in engine.capabilities and rng.random() < 0.2:
            engine.apply_wrench(rng.standard_normal((len(rows), 1, 6)), [int(rng.choice(free))], rows)
        if engine.parameters and rng.random() < 0.15:
            name = str(rng.choice(sorted(n for n in engine.parameters if not PARAMETERS[n].index_of)))
            values = engine.get_parameters(name, rows)
            values = values * rng.uniform(0.8, 1.2, (len(rows), *[1] * (values.ndim - 1)))
            engine.set_parameters(name, np.minimum(values, 0.99) if name == "geom.restitution" else values, rows)
        if rng.random() < 0.1:
            twist = engine.get_state().body_twist[rows][:, free] + 0.1 * rng.standard_normal(6)
            engine.set_body_state(twist=twist, env_ids=rows, bodies=free)
        if len(world.joints) and rng.random() < 0.05:
            engine.set_joint_state(velocity=0.2 * rng.standard_normal((len(rows), len(world.joints))), env_ids=rows)
        engine.step(int(rng.integers(1, 5)), None if len(rows) == engine.num_envs else rows)
        digest.update(state_digest(engine, rows).encode())
    return digest.hexdigest()


def state_digest(engine: SimEngine, rows: list[int]) -> str:
    """The bits of all fields of the state, and of the contact points, of some envs in order."""
    digest, state = hashlib.sha256(), engine.get_state()
    for name in FIELDS:
        digest.update(np.ascontiguousarray(getattr(state, name)[rows]).tobytes())
    if Capability.CONTACT_POINTS in engine.capabilities:
        for env in rows:
            for column in engine.contacts([env])[1:]:
                digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def until_touch(engine: SimEngine, number: int, most: int) -> bool:
    """Go on until something touches something in all envs, for so many rounds at most; whether it does."""
    if Capability.CONTACT_POINTS not in engine.capabilities:
        return False
    rows = list(range(engine.num_envs))
    for part in range(most):
        if set(engine.contacts().env.tolist()) == set(rows):
            return True
        treat(engine, number, 100 + part, 1, rows)
    return False


def wild(engine: SimEngine, number: int) -> None:
    """Throw everything far away, fast, turn gravity round, and go on for a while."""
    rng = np.random.default_rng([number, 99])
    world = engine.world
    free = [i for i, b in enumerate(world.bodies) if b.kind == "free"]
    pose = engine.get_state().body_pose[:, free].copy()
    pose[..., :3] += 100.0 * rng.standard_normal(3)
    engine.set_body_state(pose, 20.0 * rng.standard_normal((engine.num_envs, len(free), 6)), bodies=free)
    if len(world.joints):
        shape = (engine.num_envs, len(world.joints))
        engine.set_joint_state(velocity=3.0 * rng.standard_normal(shape))
    for name, factor in (("world.gravity", -1.0), ("body.mass", 2.0), ("geom.friction", 0.5), ("joint.damping", 3.0)):
        if name in engine.parameters:
            engine.set_parameters(name, factor * engine.get_parameters(name))
    engine.step(int(rng.integers(3, 30)))
    engine.reset([0])
    engine.step(4)


# ---------------------------------------------------------------------- another process


def store(snapshots: dict[int, Snapshot], file: Path) -> None:
    """Snapshots of scenes, by number, as plain arrays."""
    arrays: dict[str, Any] = {}
    for number, snapshot in snapshots.items():
        stamp = [snapshot.engine, snapshot.engine_version, snapshot.world_hash, snapshot.level.value]
        arrays[f"{number}/stamp"] = np.array(stamp)
        arrays |= {f"{number}/data/{name}": rows for name, rows in snapshot.data.items()}
    np.savez(file, allow_pickle=False, **arrays)


def stored(file: Path) -> dict[int, Snapshot]:
    """What `store` wrote."""
    stamps: dict[int, list[str]] = {}
    data: dict[int, dict[str, Array]] = {}
    with np.load(file, allow_pickle=False) as arrays:
        for key in arrays.files:
            number, _, name = key.partition("/")
            if name == "stamp":
                stamps[int(number)] = arrays[key].tolist()
            else:
                data.setdefault(int(number), {})[name.removeprefix("data/")] = arrays[key]
    found: dict[int, Snapshot] = {}
    for number, (engine, version, world, level) in stamps.items():
        found[number] = Snapshot(engine, version, world, SnapshotLevel(level), data[number])
    return found


def go_on(name: str, file: Path, length: int) -> dict[int, list[str]]:
    """Restore each into a new engine; digests of the state at once and of what follows."""
    found: dict[int, list[str]] = {}
    for number, snapshot in stored(file).items():
        with build(name, number, snapshot.num_envs) as engine:
            rows = list(range(snapshot.num_envs))
            engine.restore(snapshot)
            found[number] = [state_digest(engine, rows), treat(engine, number, 2, length, rows)]
    return found


if __name__ == "__main__":
    print(json.dumps(go_on(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]))))
