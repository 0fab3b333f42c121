"""MJCF files imported and stepped, against MuJoCo itself on the same files.

    python benchmarks/models.py FOLDER|FILE... [--json docs/models.json] [--names NAME...]

Every tree of bodies that moves in a file is imported by its name. Totals of mass and inertia (relative), limits,
springs, damping and armature are compared with those that MuJoCo has compiled, as the largest difference; then both
are stepped 100 times from the same state under the same efforts, with the step, the gravity, the fluid of the file
and the integrator `implicitfast` on both sides, without contacts and limits: `motion` is the largest difference of a
joint's position
[rad] or [m]. What acts in the file and is not in the model is named. `--names` are words for the folders in the
results.
"""

import argparse
import json
import sys
import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from math import inf
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from anysim import load
from anysim.api import compile_world
from anysim.assets.load import import_asset
from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.engine.factory import create_simulation
from anysim.errors import AnysimError
from anysim.model.world import Actuator, BodyKind, ControlMode, World
from anysim_mujoco.mjcf.unheld import is_fixed, tendon_effects

STEPS = 100


@dataclass(frozen=True)
class Row:
    """One tree of one file; differences are NaN-free numbers, and `refused` is the reason where there are none."""

    source: str
    model: str
    joints: int = 0
    springs: int = 0
    notes: int = 0
    mass: float = 0.0
    inertia: float = 0.0
    limits: float = 0.0
    passive: float = 0.0
    motion: float = 0.0
    alone: str = ""
    refused: str = ""


def trees(path: Path) -> list[str]:
    """The names of the bodies of a file's world with joints in or below them."""
    model = mujoco.MjModel.from_xml_path(str(path))
    roots = {int(model.body_rootid[model.jnt_bodyid[j]]) for j in range(model.njnt)}
    return [model.body(i).name for i in sorted(roots)]


class Raw:
    """MuJoCo's own reading of a file, of which one tree is looked at."""

    def __init__(self, path: Path, body: str) -> None:
        self.model = model = mujoco.MjModel.from_xml_path(str(path))
        self.root = model.body(body).id if body else 1
        self.bodies = [i for i in range(1, model.nbody) if model.body_rootid[i] == self.root]
        every = [j for j in range(model.njnt) if model.jnt_bodyid[j] in self.bodies]
        self.free = [j for j in every if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE]
        self.joints = [j for j in every if j not in self.free]
        self.q, self.v = model.jnt_qposadr[self.joints], model.jnt_dofadr[self.joints]
        off = mujoco.mjtDisableBit
        model.opt.disableflags |= int(off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_ACTUATION)
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        self.data = mujoco.MjData(model)

    def totals(self) -> tuple[float, Array]:
        """Mass, and inertia (3, 3) in the frame of the neutral root, at the file's zero."""
        data, model = self.data, self.model
        data.qpos[self.q] = 0.0
        mujoco.mj_kinematics(model, data)
        whole, tensor, own = 0.0, np.zeros((3, 3)), bool(self.free) or not model.body_jntnum[self.root]
        origin = data.xpos[self.root] if own else np.zeros(3)  # what moves against the world has its base there
        for i in self.bodies:
            turn, arm = data.ximat[i].reshape(3, 3), data.xipos[i] - origin
            mass = float(model.body_mass[i])
            tensor += turn @ np.diag(model.body_inertia[i]) @ turn.T
            tensor += mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
            whole += mass
        axes = data.xmat[self.root].reshape(3, 3) if own else np.eye(3)
        return whole, axes.T @ tensor @ axes


def totals(world: World) -> tuple[float, Array]:
    """Those of the neutral model, with its joints at zero."""
    from anysim.kinematics import inertia
    from anysim.math import pose as P

    poses, whole, tensor = [], 0.0, np.zeros((3, 3))
    for body in world.bodies:
        own = P.pose(np.array(body.position), np.array(body.quaternion))
        poses.append(own if body.parent < 0 else P.compose(poses[body.parent], own))
        part, turn = body.inertial, P.to_matrix(poses[-1][3:])
        arm = poses[-1][:3] + turn @ np.array(part.com) - poses[0][:3]
        tensor += turn @ inertia.tensor(part) @ turn.T + part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        whole += part.mass
    return whole, tensor


def compared(path: Path, body: str, source: str) -> Row:
    """The row of one tree."""
    name = f"{path.name}#{body}" if body else path.name
    uri = f"file:{path}" + (f"#{body}" if body else "")
    try:
        model = import_asset(uri)
        raw = Raw(path, body)
        return _row(model, _world(uri, model, raw), raw, Row(source, name))
    except AnysimError as error:
        return Row(source, name, refused=str(error).replace(f"{path}: ", "").replace(str(path), path.name))


def _world(uri: str, model: ImportedModel, raw: Raw) -> World:
    """A world of the model alone, with the file's step and gravity, an effort drive a joint, no contacts and limits."""
    fixed = model.bodies[0].kind is BodyKind.STATIC
    thing = {"source": {"asset": uri}} | ({"fixed": True} if fixed else {})
    world = compile_world(load({"world": {"objects": {"thing": thing}}}))
    dt, gravity = float(raw.model.opt.timestep), tuple(float(g) for g in raw.model.opt.gravity)
    if raw.model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY):
        gravity = (0.0, 0.0, 0.0)
    return replace(
        world,
        physics=replace(world.physics, dt=dt, gravity=gravity),
        geoms=(),
        joints=tuple(replace(joint, lower=-inf, upper=inf) for joint in world.joints),
        tendons=tuple(t if t.lower == t.upper else replace(t, lower=-inf, upper=inf) for t in world.tendons),
        actuators=tuple(
            Actuator(f"drive {i}", i, ControlMode.EFFORT, 0.0, 0.0)
            for i, joint in enumerate(world.joints)
            if joint.mimic is None
        ),
    )


def _row(model: ImportedModel, world: World, raw: Raw, row: Row) -> Row:
    theirs, joints = raw.model, model.joints
    (mass, tensor), (ours, own) = raw.totals(), totals(world)
    limits = [
        abs(a - b)
        for joint, j in zip(joints, raw.joints, strict=True)
        for a, b in zip((joint.lower, joint.upper), theirs.jnt_range[j], strict=True)
        if theirs.jnt_limited[j]
    ]
    passive = [
        [joint.damping - theirs.dof_damping[v], joint.armature - theirs.dof_armature[v]]
        + [joint.friction - theirs.dof_frictionloss[v], joint.stiffness - theirs.jnt_stiffness[j]]
        + ([joint.spring_rest - theirs.qpos_spring[q]] if joint.stiffness else [])
        for joint, j, q, v in zip(joints, raw.joints, raw.q, raw.v, strict=True)
    ]
    return replace(
        row,
        joints=len(joints),
        springs=sum(joint.stiffness > 0 for joint in joints),
        notes=len(model.report),
        mass=abs(ours / mass - 1.0),
        inertia=float(np.abs(own - tensor).max() / np.abs(tensor).max()),
        limits=max(limits, default=0.0),
        passive=max((abs(float(v)) for part in passive for v in part), default=0.0),
        motion=_motion(world, raw),
        alone=", ".join(_alone(model, raw)),
    )


def _alone(model: ImportedModel, raw: Raw) -> Iterator[str]:
    """What moves the bodies of a file and is not in the model."""
    spatial = [t for t in range(raw.model.ntendon) if not is_fixed(raw.model, t)]
    acting = sum(bool(tendon_effects(raw.model, t)) for t in spatial) - len(model.spatial_tendons)
    if acting:
        yield f"{acting} tendons to other trees"
    if any(note.where == "joint damping" and "free joint" in note.message for note in model.report):
        yield "damping of a free joint"
    if any(note.where == "joint armature" and "free joint" in note.message for note in model.report):
        yield "armature of a free joint"


def _motion(world: World, raw: Raw) -> float:
    model, data = raw.model, raw.data
    data.qpos[raw.q] = [joint.initial for joint in world.joints]
    option = model.opt
    fluid = {
        "density": float(option.density),
        "viscosity": float(option.viscosity),
        "wind": tuple(option.wind.tolist()),
    }
    engine = create_simulation("mujoco", constraints="mujoco", **fluid).create_world(world)
    try:
        if raw.free:
            at = int(model.jnt_qposadr[raw.free[0]])
            place = data.qpos[at : at + 7]
            engine.set_body_state(pose=[*place[:3], *place[4:], place[3]], bodies=[0])
        engine.set_joint_state(position=[joint.initial for joint in world.joints])
        driven = [a.joint for a in world.actuators]
        effort = 5.0 * model.dof_M0[raw.v] * np.cos(np.arange(len(raw.v)))  # some 5 rad/s^2, to either side
        data.qfrc_applied[raw.v[driven]] = effort[driven]
        if driven:
            engine.set_control(effort=effort[driven])
        worst = 0.0
        for _ in range(STEPS):
            mujoco.mj_step(model, data)
            engine.step()
            worst = max(worst, float(np.abs(engine.get_state().joint_pos[0] - data.qpos[raw.q]).max(initial=0.0)))
        return worst
    finally:
        engine.destroy()


def rows(path: Path, source: str) -> list[Row]:
    """The rows of one file."""
    try:
        found = trees(path)
    except ValueError as error:
        return [Row(source, path.name, refused=f"MuJoCo cannot read it: {' '.join(str(error).split())}")]
    if len(found) == 1 and len(mujoco.MjSpec.from_file(str(path)).worldbody.bodies) == 1:
        return [compared(path, "", source)]
    return [compared(path, body, source) for body in found] or [compared(path, "", source)]


def main() -> int:
    """Print the table, or write it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", nargs="+", type=Path, help="folders of MJCF files, or files")
    parser.add_argument("--names", nargs="*", default=[], help="a name for each of them, in the results")
    parser.add_argument("--json", type=Path, help="write the results there")
    options = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)  # of attributes that MuJoCo will read no more one day
    results: list[dict[str, Any]] = []
    for number, folder in enumerate(options.sources):
        source = options.names[number] if number < len(options.names) else folder.name
        for path in sorted(folder.glob("*.xml")) if folder.is_dir() else [folder]:
            for row in rows(path.resolve(), source):
                results.append(asdict(row))
                line = row.refused or f"{row.joints} joints, motion {row.motion:.1e} ({row.alone})"
                sys.stdout.write(f"{source} {row.model}: {line}\n")
                sys.stdout.flush()
    if options.json is not None:
        options.json.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
