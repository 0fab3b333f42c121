"""World to MuJoCo model: a natively built MjSpec, compiled."""

from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np

from anysim.conventions import WORLD, Array, wxyz_from_xyzw
from anysim.engine.control import MODES, acting_gains
from anysim.errors import EngineError
from anysim.kinematics.inertia import check_physical
from anysim.model.world import Actuation, Body, BodyKind, ConstraintKind, ContactSensor, Joint, JointType, World
from anysim_mujoco.audit import UNLIMITED
from anysim_mujoco.geoms import add_assets, add_geom, add_look
from anysim_mujoco.inertia import principal
from anysim_mujoco.layout import Handles, Layout
from anysim_mujoco.options import MujocoOptions
from anysim_mujoco.surfaces import DRY_IMPEDANCE, STIFF_IMPEDANCE, constraint_solref


class BuiltModel(NamedTuple):
    """A compiled model and where the World's things are in it."""

    model: Any
    layout: Layout


def build(world: World, options: MujocoOptions) -> BuiltModel:
    """Compile a World.

    Raises:
        EngineError: MuJoCo refuses it; carries MuJoCo's words, which name the element.
    """
    spec = mujoco.MjSpec()
    _settings(spec, world, options)
    add_look(spec, world, options)
    add_assets(spec, world)
    bodies = _bodies(spec, world)
    owner = lambda body: spec.worldbody if body == WORLD else bodies[body]  # noqa: E731
    joints = [_joint(owner(joint.body), joint, world) for joint in world.joints]
    geoms = [add_geom(spec, owner(geom.body), geom, world) for geom in world.geoms]
    _couplings(spec, world)
    _constraints(spec, world, owner)
    _tendons(spec, world)
    _drives(spec, world)
    sensors = [_contact_sensor(spec, world, sensor) for sensor in world.contact_sensors]
    for low, high in sorted(world.excluded_pairs):
        spec.add_exclude(bodyname1=body_name(world, low), bodyname2=body_name(world, high))
    try:
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        said = " ".join(str(error).split())
        raise EngineError(f"MuJoCo cannot build the world '{world.name}': {said}") from error
    return BuiltModel(model, Layout.of(world, model, Handles(bodies, joints, geoms, sensors)))


def initial_row(world: World, model: Any, layout: Layout) -> Array:
    """The state row of an env after a reset."""
    data = mujoco.MjData(model)
    data.qpos[layout.joint_q] = [joint.initial for joint in world.joints]
    row = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(model, data, row, mujoco.mjtState.mjSTATE_INTEGRATION)
    return row


def body_name(world: World, body: int) -> str:
    """The name of a body in the MjSpec: its own, but for one called `world`, which is taken."""
    name = "world" if body == WORLD else world.bodies[body].name
    return "world (body)" if body != WORLD and name == "world" else name


def _settings(spec: Any, world: World, options: MujocoOptions) -> None:
    physics = world.physics
    spec.modelname = world.name
    spec.compiler.degree = False
    spec.compiler.alignfree = False  # a free body's frame is the World's, not that of its inertia
    spec.compiler.fusestatic = False
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    if options.memory_mb:
        spec.memory = options.memory_mb * 2**20
    elif (crowd := len(world.bodies)) > 1000:
        # its own estimate is 24 GB for 4,000 that move; all pairs of bodies and a ball's contact take 4 and 8,000 bytes
        spec.memory = 4 * crowd**2 + 100_000 * crowd
    option = spec.option
    option.timestep = physics.dt
    option.gravity = physics.gravity
    option.impratio = physics.impratio
    option.cone = getattr(mujoco.mjtCone, f"mjCONE_{physics.friction_cone.upper()}")
    # Euler takes the joints' own damping implicitly and that of drives explicitly: the one difference between the two
    explicit = physics.actuation is Actuation.EXPLICIT_PD
    option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{'EULER' if explicit else options.integrator.upper()}")
    option.solver = getattr(mujoco.mjtSolver, f"mjSOL_{options.solver.upper()}")
    option.jacobian = getattr(mujoco.mjtJacobian, f"mjJAC_{options.jacobian.upper()}")
    option.iterations = options.iterations
    option.tolerance = options.tolerance
    # a diverged env must show it: MuJoCo would put it back to its default pose in silence
    option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def _bodies(spec: Any, world: World) -> list[Any]:
    made: list[Any] = []
    for index, body in enumerate(world.bodies):
        parent = spec.worldbody if body.parent == WORLD else made[body.parent]
        element = parent.add_body(
            name=body_name(world, index),
            pos=body.position,
            quat=wxyz_from_xyzw(np.asarray(body.quaternion)),
            gravcomp=float(body.gravity_compensation),
        )
        # the compiler's shortcut for diagonal inertia matrices forbids that the centre of mass is changed later
        element.simple = False
        if body.kind is BodyKind.FREE:
            element.add_freejoint(name=f"{body.name} (free)")
        elif body.kind is BodyKind.STATIC:
            # a mocap body stands still like the world, and its pose is part of each env's state
            element.mocap = True
        _set_inertia(element, body)
        made.append(element)
    return made


def _set_inertia(element: Any, body: Body) -> None:
    moments, frame = principal(np.asarray(body.inertial.inertia))
    if body.kind is not BodyKind.STATIC and body.inertial.mass > 0 and moments.any():
        check_physical(body.name, moments)
    element.explicitinertial = True
    element.mass, element.ipos = body.inertial.mass, body.inertial.com
    element.inertia, element.iquat = moments, frame


def _joint(element: Any, joint: Joint, world: World) -> Any:
    limited = bool(np.isfinite(joint.lower) or np.isfinite(joint.upper))
    kinds = {JointType.REVOLUTE: mujoco.mjtJoint.mjJNT_HINGE, JointType.PRISMATIC: mujoco.mjtJoint.mjJNT_SLIDE}
    stiff = constraint_solref(0.0, world.physics.dt)
    return element.add_joint(
        name=joint.name,
        type=kinds[joint.type],
        axis=joint.axis,
        pos=joint.anchor,
        armature=joint.armature,
        damping=[joint.damping, 0.0, 0.0],
        stiffness=[joint.stiffness, 0.0, 0.0],
        springref=joint.spring_rest,
        frictionloss=joint.friction,
        solref_friction=stiff,
        solimp_friction=DRY_IMPEDANCE,
        limited=int(limited),
        range=(max(joint.lower, -UNLIMITED), min(joint.upper, UNLIMITED)),
        solref_limit=constraint_solref(joint.limit_softness, world.physics.dt),
        solimp_limit=STIFF_IMPEDANCE,
    )


def _couplings(spec: Any, world: World) -> None:
    for joint in world.joints:
        if joint.mimic is None:
            continue
        equality = spec.add_equality(
            name=f"{joint.name} (mimic)",
            type=mujoco.mjtEq.mjEQ_JOINT,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            name1=joint.name,
            name2=world.joints[joint.mimic.joint].name,
            solref=constraint_solref(joint.limit_softness, world.physics.dt),
            solimp=STIFF_IMPEDANCE,
        )
        data = np.zeros_like(equality.data)
        data[:2] = joint.mimic.offset, joint.mimic.multiplier
        data[2 : 2 + len(joint.mimic.curve)] = joint.mimic.curve
        equality.data = data


def _constraints(spec: Any, world: World, owner: Callable[[int], Any]) -> None:
    """Frames that are held together, as sites: what MuJoCo makes of bodies depends on where they begin."""
    kinds = {ConstraintKind.CONNECT: mujoco.mjtEq.mjEQ_CONNECT, ConstraintKind.WELD: mujoco.mjtEq.mjEQ_WELD}
    for one in world.constraints:
        names = [f"{one.name} (frame)", f"{one.name} (other frame)"]
        ends = (one.body, one.position, one.quaternion), (one.other, one.other_position, one.other_quaternion)
        for name, (body, position, quaternion) in zip(names, ends, strict=True):
            owner(body).add_site(name=name, pos=position, quat=wxyz_from_xyzw(np.asarray(quaternion)))
        equality = spec.add_equality(
            name=f"{one.name} (constraint)",
            type=kinds[one.kind],
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            name1=names[0],
            name2=names[1],
            solref=constraint_solref(one.softness, world.physics.dt),
            solimp=STIFF_IMPEDANCE,
        )
        data = np.zeros_like(equality.data)
        data[10] = 1.0  # how a weld weighs turns against shifts
        equality.data = data


def _tendons(spec: Any, world: World) -> None:
    for one in world.tendons:
        held = one.lower == one.upper
        limited = not held and bool(np.isfinite(one.lower) or np.isfinite(one.upper))
        tendon = spec.add_tendon(
            name=one.name,
            stiffness=[one.stiffness, 0.0, 0.0],
            springlength=one.rest,
            damping=[one.damping, 0.0, 0.0],
            frictionloss=one.friction,
            armature=one.armature,
            solref_friction=constraint_solref(0.0, world.physics.dt),
            solimp_friction=DRY_IMPEDANCE,
            limited=int(limited),
            range=(max(one.lower, -UNLIMITED), min(one.upper, UNLIMITED)) if limited else (0.0, 0.0),
            solref_limit=constraint_solref(one.limit_softness, world.physics.dt),
            solimp_limit=STIFF_IMPEDANCE,
        )
        for joint, coefficient in zip(one.joints, one.coefficients, strict=True):
            tendon.wrap_joint(world.joints[joint].name, coefficient)
        if held:
            equality = spec.add_equality(
                name=f"{one.name} (held)",
                type=mujoco.mjtEq.mjEQ_TENDON,
                objtype=mujoco.mjtObj.mjOBJ_TENDON,
                name1=one.name,
                solref=constraint_solref(one.limit_softness, world.physics.dt),
                solimp=STIFF_IMPEDANCE,
            )
            data = np.zeros_like(equality.data)
            data[0] = one.lower
            equality.data = data


def _drives(spec: Any, world: World) -> None:
    for actuator in world.actuators:
        target, kind = world.joints[actuator.joint].name, mujoco.mjtTrn.mjTRN_JOINT
        if actuator.shares:
            target, kind = f"{actuator.name} (drive)", mujoco.mjtTrn.mjTRN_TENDON
            tendon = spec.add_tendon(name=target)
            for joint, ratio in ((actuator.joint, 1.0), *actuator.shares):
                tendon.wrap_joint(world.joints[joint].name, ratio)
        element = spec.add_actuator(
            name=actuator.name,
            target=target,
            trntype=kind,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            ctrllimited=0,
            forcelimited=1,
            forcerange=(-actuator.effort_limit, actuator.effort_limit),
        )
        gain, bias = np.zeros_like(element.gainprm), np.zeros_like(element.biasprm)
        gain[0] = 1.0
        mode, kp, kd = np.array([MODES.index(actuator.mode)]), np.array([actuator.kp]), np.array([actuator.kd])
        bias[1:3] = -np.concatenate(acting_gains(mode, kp, kd))
        element.gainprm, element.biasprm = gain, bias


def _contact_sensor(spec: Any, world: World, sensor: ContactSensor) -> list[Any]:
    """One MuJoCo sensor per pair of a body and what it may touch; their sum is the neutral sensor."""
    body = mujoco.mjtObj.mjOBJ_BODY
    parts = []
    for index in sensor.bodies:
        for other in sensor.against if sensor.against is not None else (None,):
            element = spec.add_sensor(
                name=f"{sensor.name} ({len(parts)})",
                type=mujoco.mjtSensor.mjSENS_CONTACT,
                objtype=body,
                objname=body_name(world, index),
            )
            if other is not None:
                element.reftype, element.refname = body, body_name(world, other)
            setup = np.zeros_like(element.intprm)
            setup[:3] = 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1  # the force, summed over contacts
            element.intprm = setup
            parts.append(element)
    return parts
