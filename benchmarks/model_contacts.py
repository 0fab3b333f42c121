"""MJCF files in contact: all that is in a file, stepped 100 times, against MuJoCo itself on the same file.

    python benchmarks/model_contacts.py FOLDER|FILE... [--json docs/model_contacts.json] [--names NAME...]

Every tree of bodies of a file becomes an object of one world, where the file has it, and what is fixed to the file's
world is the ground. Both sides begin at the file's own pose, lowered until something touches, and take the same
efforts, in contact and between their limits; the file's own drives are off on both. On MuJoCo the world has the file's
step, gravity, cone, integrator and solver, and its constraints are as soft as MuJoCo has them. `mujoco` is the largest
difference of a joint's position [rad] or [m] or a floating body's place [m] from MuJoCo itself, the other engines'
columns are theirs, or why they refuse the world; `touching` counts the steps in which the file has contacts.
"""

import argparse
import json
import sys
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import combinations
from math import inf
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from anysim import load
from anysim.api import compile_world
from anysim.assets.load import import_asset
from anysim.conventions import IDENTITY_QUATERNION, WORLD, Array
from anysim.engine.factory import create_simulation
from anysim.errors import AnysimError
from anysim.math import pose as P
from anysim.model.world import Actuator, BodyKind, ControlMode, SpatialTendon, World
from anysim_mujoco.mjcf.couplings import Couplings
from anysim_mujoco.mjcf.geoms import GeomReader, pose_of

STEPS = 100
FREE, SLIDE = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_SLIDE)


@dataclass
class Row:
    """One file; `refused` names the trees that are not in the world, with the reason."""

    source: str
    model: str
    touching: int = 0
    mujoco: float | None = None
    others: dict[str, Any] = field(default_factory=dict[str, Any])
    refused: dict[str, str] = field(default_factory=dict[str, str])


class Source:
    """A file as MuJoCo reads it, with its drives off, lowered until something touches."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.model = model = mujoco.MjModel.from_xml_path(str(path))
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
        roots = {int(model.body_rootid[model.jnt_bodyid[j]]) for j in range(model.njnt)}
        self.trees = sorted(roots)
        self.data = mujoco.MjData(model)
        self._lower()

    def _lower(self) -> None:
        """Bring what hangs freely down, a millimetre at a time, where nothing touches at the file's pose."""
        model, data = self.model, self.data
        mujoco.mj_forward(model, data)
        heights = [
            (int(model.jnt_qposadr[j]) + 2 * (model.jnt_type[j] == FREE), 1.0)
            if model.jnt_type[j] == FREE
            else (int(model.jnt_qposadr[j]), float(np.sign(data.xaxis[j, 2])))
            for j in range(model.njnt)
            if model.jnt_bodyid[j] in self.trees
            if model.jnt_type[j] == FREE or (model.jnt_type[j] == SLIDE and abs(data.xaxis[j, 2]) > 0.99)
        ]
        start = data.qpos.copy()
        for sunk in np.arange(0.0, 2.0 if heights else 1e-9, 0.001):
            data.qpos[:] = start
            for at, sign in heights:
                data.qpos[at] -= sign * sunk
            mujoco.mj_forward(model, data)
            if any(contact.dist < -1e-3 for contact in data.contact):
                return
        data.qpos[:] = start
        mujoco.mj_forward(model, data)


def scene(source: Source, row: Row) -> tuple[World, list[int]]:
    """The world of a file, and the roots of the trees in it; those that are refused go into the row."""
    objects: dict[str, Any] = {}
    kept: list[int] = []
    model = source.model
    for root in source.trees:
        name = model.body(root).name
        uri = f"file:{source.path}" + (f"#{name}" if name else "")
        fixed = model.jnt_type[model.body_jntadr[root]] != FREE if model.body_jntnum[root] else True
        thing = {"source": {"asset": uri}} | ({"fixed": True} if fixed else {})
        try:
            alone = compile_world(load({"world": {"objects": {"thing": thing}}}))
            create_simulation("mujoco").create_world(alone).destroy()
        except AnysimError as error:
            row.refused[name] = str(error).replace(f"{source.path}: ", "").splitlines()[0]
            continue
        objects[f"tree{root}"] = thing
        kept.append(root)
    world = compile_world(load({"world": {"objects": objects, "terrain": {"kind": "none"}}}))
    world = replace(world, spatial_tendons=(*world.spatial_tendons, *strings(source, world, kept)))
    reader = GeomReader(model, str(source.path), 1.0, 0.0, [])
    mujoco.mj_kinematics(model, source.data)
    for number in range(model.nbody):
        if model.body_weldid[number] == 0 and model.body_rootid[number] not in kept:
            place = pose_of(source.data.xpos[number], source.data.xquat[number], 1.0)
            reader.read(f"ground{number}", number, WORLD, place)
    option = model.opt
    gravity = tuple(float(g) for g in option.gravity)
    if option.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
        gravity = (0.0, 0.0, 0.0)
    cone = "pyramidal" if option.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL else "elliptic"
    physics = replace(
        world.physics, dt=float(option.timestep), gravity=gravity, friction_cone=cone, impratio=float(option.impratio)
    )
    ground = tuple(replace(geom, name=f"ground.{geom.name}", visible=False) for geom in reader.geoms if geom.collides)
    world = replace(world, excluded_pairs=world.excluded_pairs | apart(source, world, kept))
    off, flags = mujoco.mjtDisableBit, option.disableflags
    if flags & int(off.mjDSBL_CONTACT | off.mjDSBL_CONSTRAINT):
        world = replace(world, geoms=tuple(replace(geom, collides=False) for geom in world.geoms))
    if flags & int(off.mjDSBL_LIMIT | off.mjDSBL_CONSTRAINT):
        world = replace(world, joints=tuple(replace(joint, lower=-inf, upper=inf) for joint in world.joints))
    return replace(
        world,
        physics=physics,
        geoms=(*world.geoms, *ground),
        meshes=(*world.meshes, *reader.meshes.values()),
        heightfields=(*world.heightfields, *reader.heightfields.values()),
        actuators=tuple(
            Actuator(f"drive {i}", i, ControlMode.EFFORT, 0.0, 0.0)
            for i, joint in enumerate(world.joints)
            if joint.mimic is None
        ),
    ), kept


def strings(source: Source, world: World, roots: list[int]) -> Iterator[SpatialTendon]:
    """Those that tie a tree to another: trees that are imported one by one have none of them."""
    model, place = source.model, dict[int, tuple[int, Array]]()
    for number in range(1, model.nbody):
        if (root := int(model.body_rootid[number])) in roots:
            entity = world.entities[roots.index(root)]
            asset = import_asset(entity.source)
            frame = asset.frames[model.body(number).name or f"body{number - root + 1}"]
            place[number] = entity.body_start + frame.body, P.pose(frame.position, frame.quaternion)
    if len(place) == model.nbody - 1:
        whole = Couplings(model, 1.0, {}, lambda _: 1.0, place, False, P.pose((0.0,) * 3, IDENTITY_QUATERNION))
        for tendon in whole.spatial_tendons():
            if len({world.body_entity[body] for body in tendon.bodies}) > 1:
                yield tendon


def apart(source: Source, world: World, roots: list[int]) -> frozenset[tuple[int, int]]:
    """The pairs of bodies of different trees, or of one and the world, none of whose shapes meet in the file."""
    model, shapes = source.model, dict[int, list[int]]()
    for number in range(model.nbody):
        root, body = int(model.body_rootid[number]), WORLD
        if root in roots:
            entity = world.entities[roots.index(root)]
            links = import_asset(entity.source).links
            body = entity.body_start + links[model.body(number).name or f"body{number - root + 1}"]
        first = int(model.body_geomadr[number])
        shapes.setdefault(body, []).extend(range(first, first + int(model.body_geomnum[number])))
    masks = np.stack([model.geom_contype, model.geom_conaffinity])
    excluded = {frozenset((int(n) >> 16, int(n) & 0xFFFF)) for n in model.exclude_signature}
    found: set[tuple[int, int]] = set()
    for low, high in combinations(sorted(shapes), 2):
        if low != WORLD and world.body_entity[low] == world.body_entity[high]:
            continue
        meet = (
            (masks[0, i] & masks[1, k] or masks[0, k] & masks[1, i])
            and frozenset((int(model.geom_bodyid[i]), int(model.geom_bodyid[k]))) not in excluded
            for i in shapes[low]
            for k in shapes[high]
        )
        if not any(meet):
            found.add((low, high))
    return frozenset(found)


def options(model: Any) -> dict[str, Any]:
    """MuJoCo's own, as the file has them."""
    option = model.opt
    word = lambda kind, value: kind(value).name.rpartition("_")[2].lower()  # noqa: E731
    return {
        "integrator": word(mujoco.mjtIntegrator, option.integrator),
        "solver": word(mujoco.mjtSolver, option.solver),
        "jacobian": word(mujoco.mjtJacobian, option.jacobian),
        "iterations": int(option.iterations),
        "tolerance": float(option.tolerance),
        "ls_iterations": int(option.ls_iterations),
        "noslip_iterations": int(option.noslip_iterations),
        "constraints": "mujoco",
        "density": float(option.density),
        "viscosity": float(option.viscosity),
        "wind": tuple(float(v) for v in option.wind),
        "threads": 1,
    }


class Track:
    """MuJoCo's own way: `joints` (steps, J) and places of floating bodies (steps, F, 3), and where both began."""

    def __init__(self, source: Source, roots: list[int], world: World) -> None:
        model, data = source.model, source.data
        inside = [j for j in range(model.njnt) if model.body_rootid[model.jnt_bodyid[j]] in roots]
        free = [j for j in inside if model.jnt_type[j] == FREE]
        joints = [j for j in inside if j not in free]
        q, v = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        at = model.jnt_qposadr[free]
        self.position = data.qpos[q].copy()
        self.poses = {
            n: pose_of(data.xpos[root], data.xquat[root], 1.0)
            for n, root in enumerate(roots)
            if model.jnt_type[model.body_jntadr[root]] == FREE or not model.body_jntnum[root]
        }
        self.floating = [n for n, root in enumerate(roots) if model.jnt_type[model.body_jntadr[root]] == FREE]
        driven = [a.joint for a in world.actuators]
        effort = 5.0 * model.dof_M0[v] * np.cos(np.arange(len(v)))  # some 5 rad/s^2, to either side
        data.qfrc_applied[v[driven]] = effort[driven]
        self.effort = effort[driven]
        self.joints, self.places, self.touching = np.empty((STEPS, len(q))), np.empty((STEPS, len(at), 3)), 0
        for step in range(STEPS):
            mujoco.mj_step(model, data)
            self.joints[step], self.places[step] = data.qpos[q], data.qpos[at[:, None] + np.arange(3)]
            self.touching += bool(data.ncon)


def difference(engine_name: str, given: Mapping[str, Any], world: World, track: Track) -> float:
    """The largest difference of an engine's way from MuJoCo's own."""
    engine = create_simulation(engine_name, **given).create_world(world)
    try:
        roots = [i for i, body in enumerate(world.bodies) if body.kind is not BodyKind.LINK]
        if track.poses:
            engine.set_body_state(pose=np.array([*track.poses.values()]), bodies=[roots[n] for n in track.poses])
        engine.set_joint_state(position=track.position)
        if len(track.effort):
            engine.set_control(effort=track.effort)
        floating, worst = [roots[n] for n in track.floating], 0.0
        for joints, places in zip(track.joints, track.places, strict=True):
            engine.step()
            state = engine.get_state()
            apart: list[Array] = [state.joint_pos[0] - joints, state.body_pose[0, floating, :3] - places]
            worst = max(worst, *(float(np.abs(a).max(initial=0.0)) for a in apart))
        return worst
    finally:
        engine.destroy()


def compared(path: Path, source: str, engines: tuple[str, ...]) -> Row:
    """The row of one file."""
    row = Row(source, path.name)
    try:
        own = Source(path)
        world, roots = scene(own, row)
    except (AnysimError, ValueError) as error:
        return replace(row, refused={"": " ".join(str(error).split()).replace(str(path), path.name)})
    if not roots:
        row.refused.setdefault("", "nothing in it moves")
        return row
    track = Track(own, roots, world)
    row.touching = track.touching
    for engine in engines:
        try:
            worst = difference(engine, options(own.model) if engine == "mujoco" else {}, world, track)
        except AnysimError as error:
            row.others[engine] = str(error).splitlines()[0]
            continue
        if engine == "mujoco":
            row.mujoco = worst
        else:
            row.others[engine] = worst
    return row


def main() -> int:
    """Print the table, or write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", nargs="+", type=Path, help="folders of MJCF files, or files")
    parser.add_argument("--names", nargs="*", default=[], help="a name for each of them, in the results")
    parser.add_argument(
        "--engines", nargs="+", default=["mujoco", "pybullet", "sapien"], help="those that are compared"
    )
    parser.add_argument("--json", type=Path, help="write the results there")
    given = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)  # of attributes that MuJoCo will read no more one day
    results: list[dict[str, Any]] = []
    for number, folder in enumerate(given.sources):
        source = given.names[number] if number < len(given.names) else folder.name
        for path in sorted(folder.glob("*.xml")) if folder.is_dir() else [folder]:
            row = compared(path.resolve(), source, tuple(given.engines))
            results.append(asdict(row))
            sys.stdout.write(f"{source} {row.model}: {row.touching} {row.mujoco} {row.others} {row.refused}\n")
            sys.stdout.flush()
    if given.json is not None:
        given.json.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
