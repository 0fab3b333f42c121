"""World to MuJoCo model: a natively built MjSpec, compiled."""

from collections.abc import Callable
from itertools import product
from typing import Any, NamedTuple

import mujoco
import numpy as np

from anysim.conventions import WORLD, Array, wxyz_from_xyzw
from anysim.engine.control import MODES, acting_gains
from anysim.errors import EngineError
from anysim.kinematics.inertia import check_physical
from anysim.model.world import Actuation, Body, BodyKind, ContactSensor, Geom, Joint, JointType, Vec3, World
from anysim_mujoco.audit import UNLIMITED
from anysim_mujoco.couplings import CouplingBuilder
from anysim_mujoco.geoms import UNSEEN, add_assets, add_geom, add_look
from anysim_mujoco.inertia import principal
from anysim_mujoco.layout import Handles, Layout
from anysim_mujoco.mjcf.surfaces import DRY_IMPEDANCE, Stiffness
from anysim_mujoco.options import MujocoOptions


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
    bodies = _bodies(spec, world, fluid=bool(options.density or options.viscosity))
    owner = lambda body: spec.worldbody if body == WORLD else bodies[body]  # noqa: E731
    stiff = Stiffness(world.physics.dt, options.constraints == "mujoco")
    joints = [_joint(owner(joint.body), joint, stiff) for joint in world.joints]
    parts = Parts(world, owner, options)
    geoms = [add_geom(spec, parts.owner(geom), geom, world) for geom in world.geoms]
    CouplingBuilder(spec, world, owner, stiff).add()
    _drives(spec, world)
    sensors = [_contact_sensor(spec, parts, sensor) for sensor in world.contact_sensors]
    for low, high in sorted(world.excluded_pairs):
        for first, second in product(parts.names(low), parts.names(high)):
            spec.add_exclude(bodyname1=first, bodyname2=second)
    try:
        model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        said = " ".join(str(error).split())
        raise EngineError(f"MuJoCo cannot build the world '{world.name}': {said}") from error
    return BuiltModel(model, Layout.of(world, model, Handles(bodies, joints, geoms, sensors, parts.made)))


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


class Parts:
    """Bodies fixed to others that carry their geoms, where MuJoCo is to weigh each part of a file's body by itself."""

    def __init__(self, world: World, owner: Callable[[int], Any], options: MujocoOptions) -> None:
        self._world, self._owner, self._apart = world, owner, options.constraints == "mujoco"
        self._places: dict[tuple[int, Vec3], Any] = {}
        self._names: dict[int, list[str]] = {}
        self.made: list[tuple[int, Any]] = []
        """The World's body and the element of each."""

    def owner(self, geom: Geom) -> Any:
        """The element that a geom belongs to."""
        com = geom.part_com
        if com is None or not (self._apart and geom.collides):
            return self._owner(geom.body)
        if (geom.body, com) not in self._places:
            own = self._names.setdefault(geom.body, [])
            own.append(f"{body_name(self._world, geom.body)} (part {len(own)})")
            part = self._owner(geom.body).add_body(name=own[-1])
            part.explicitinertial, part.mass, part.ipos, part.inertia = True, 0.0, com, (0.0, 0.0, 0.0)
            self._places[geom.body, com] = part
            self.made.append((geom.body, part))
        return self._places[geom.body, com]

    def names(self, body: int) -> list[str]:
        """The names of a body in the MjSpec, and of its parts."""
        return [body_name(self._world, body), *self._names.get(body, ())]


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
    option.density, option.viscosity, option.wind = options.density, options.viscosity, options.wind
    option.jacobian = getattr(mujoco.mjtJacobian, f"mjJAC_{options.jacobian.upper()}")
    option.iterations = options.iterations
    option.tolerance = options.tolerance
    option.ls_iterations, option.noslip_iterations = options.ls_iterations, options.noslip_iterations
    # a diverged env must show it: MuJoCo would put it back to its default pose in silence
    option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)


def _bodies(spec: Any, world: World, *, fluid: bool) -> list[Any]:
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
        if fluid and body.virtual:
            _streamlined(element)
        made.append(element)
    return made


def _streamlined(element: Any) -> None:
    """Have a body feel nothing of a fluid: MuJoCo goes by its inertia, unless a shape says how it is dragged."""
    element.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=(1e-6, 0.0, 0.0),
        contype=0,
        conaffinity=0,
        group=UNSEEN,
        mass=0.0,
        fluid_ellipsoid=1,
        fluid_coefs=(0.0, 0.0, 0.0, 0.0, 0.0),
    )


def _set_inertia(element: Any, body: Body) -> None:
    moments, frame = principal(np.asarray(body.inertial.inertia))
    if body.kind is not BodyKind.STATIC and body.inertial.mass > 0 and moments.any():
        check_physical(body.name, moments)
    element.explicitinertial = True
    element.mass, element.ipos = body.inertial.mass, body.inertial.com
    element.inertia, element.iquat = moments, frame


def _joint(element: Any, joint: Joint, stiff: Stiffness) -> Any:
    limited = bool(np.isfinite(joint.lower) or np.isfinite(joint.upper))
    kinds = {JointType.REVOLUTE: mujoco.mjtJoint.mjJNT_HINGE, JointType.PRISMATIC: mujoco.mjtJoint.mjJNT_SLIDE}
    limit = stiff.fields(joint.limit_compliance, joint.limit_softness)
    dry = stiff.fields(joint.friction_compliance, impedance=DRY_IMPEDANCE)
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
        solref_friction=dry.solref,
        solimp_friction=dry.solimp,
        limited=int(limited),
        range=(max(joint.lower, -UNLIMITED), min(joint.upper, UNLIMITED)),
        solref_limit=limit.solref,
        solimp_limit=limit.solimp,
        margin=limit.margin,
    )


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


def _contact_sensor(spec: Any, whole: Parts, sensor: ContactSensor) -> list[Any]:
    """One MuJoCo sensor per pair of a body and what it may touch; their sum is the neutral sensor."""
    body = mujoco.mjtObj.mjOBJ_BODY
    parts = []
    met = None if sensor.against is None else [name for other in sensor.against for name in whole.names(other)]
    for own in (name for index in sensor.bodies for name in whole.names(index)):
        for other in (None,) if met is None else met:
            element = spec.add_sensor(
                name=f"{sensor.name} ({len(parts)})", type=mujoco.mjtSensor.mjSENS_CONTACT, objtype=body, objname=own
            )
            if other is not None:
                element.reftype, element.refname = body, other
            setup = np.zeros_like(element.intprm)
            setup[:3] = 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE), 3, 1  # the force, summed over contacts
            element.intprm = setup
            parts.append(element)
    return parts
