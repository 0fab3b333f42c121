"""Pinches: two pads on a hand that slide towards each other, press on cloth with a force, and hold it by friction.

A pad goes where the engine's finger is, by a servo whose force is limited: cloth stops it, while that finger, which
meets nothing, goes on closing. The two stay as far from the middle as each other, as fingers do that one drive moves.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from anysim.conventions import Array, wxyz_from_xyzw, xyzw_from_wxyz
from anysim.errors import PluginError, listing
from anysim.math import pose as P
from anysim.model.frames import FixedFrame
from anysim.model.world import JointType, World

MASS = 0.1
"""[kg] of a pad: a finger with its share of the drive."""
STIFFNESS = 0.8
"""Of its servo, of the mass by the square of a step."""
RUBBER = {"solref": [2.0, 1.0], "solimp": [0.999, 0.9999, 0.001, 0.5, 2.0]}
"""Contact of a pad, its time in steps: points of cloth weigh so little that any softer one lets pads through."""
OPTIONS = {"solver": "Newton", "impratio": 10}
"""Attributes of `option`: conjugate gradients do not converge on contacts as stiff as these."""
SPEED = 0.1
"""[m/s] of a pad at most: fingers of an engine may snap shut, under which cloth is not gathered but passed over."""
RESTING = 0.01
"""[m/s] of a pad that neither closes nor opens."""
STEP = 0.002
"""[s] of the solver at most."""


class Jaw(NamedTuple):
    """The two pads of a hand.

    Attributes:
        place: of the hand in `met`.
        frame: of the pads on the hand; they meet at its origin.
        axis: of that frame along which they close.
        sides: on which side of the origin each of them is, 1 or -1.
        size: (3,) [m] edges of each along the axes of the frame.
        force: [N] with which each presses.
        joints: of the engine's fingers.
        lower: (2,) [m] where the fingers touch.
        geoms: of each finger in the World; the friction of a pad is the largest of theirs.
    """

    place: int
    frame: FixedFrame
    axis: int
    sides: tuple[int, int]
    size: tuple[float, float, float]
    force: float
    joints: tuple[int, int]
    lower: Array
    geoms: tuple[tuple[int, ...], tuple[int, ...]]


class PadContact(NamedTuple):
    """What a jaw presses on.

    Attributes:
        force: (2,) [N] with which each is pushed outward, along the axis on which they close.
        faces: (n,) the triangles that touch them, one for each contact.
        places: (n, 3) [m] where.
        hand: (7,) pose of the hand's body.
        gap: [m] between the pads.
        resting: the pads neither close nor open.
    """

    force: Array
    faces: Array
    places: Array
    hand: Array
    gap: float
    resting: bool


def jaw_of(
    world: World, frame: FixedFrame, joint: int, place: int, size: tuple[float, float, float], force: float
) -> Jaw:
    """The jaw of two fingers that slide on the hand of a frame, of which `joint` moves one.

    Raises:
        PluginError: they are not two, do not slide along an axis of the frame, or have no lower limits or shapes.
    """
    joints, bodies = world.joints, world.bodies
    one = joints[joint]
    if one.type is not JointType.PRISMATIC or bodies[one.body].parent != frame.body:
        raise PluginError(
            f"'{one.name}' does not slide a finger on the body of `tool`; a pinch needs two that do, `grip: sticky` "
            f"holds with any hand"
        )

    def along(number: int) -> Array:
        way = P.rotate(np.array(bodies[joints[number].body].quaternion), np.array(joints[number].axis))
        return P.rotate_inverse(np.array(frame.quaternion), way)

    others = [
        number
        for number, other in enumerate(joints)
        if other.type is JointType.PRISMATIC
        and bodies[other.body].parent == frame.body
        and along(number) @ along(joint) < -0.999
    ]
    if len(others) != 1:
        found = listing([joints[number].name for number in others]) if others else "there is none"
        raise PluginError(f"one finger has to slide opposite to '{one.name}' on the same body ({found})")
    way, pair = along(joint), (joint, others[0])
    axis = int(np.argmax(np.abs(way)))
    if abs(way[axis]) < 0.999:
        words = ", ".join(f"{x:.2f}" for x in way)
        raise PluginError(f"'{one.name}' slides along ({words}) of `tool`; a pinch needs a frame with an axis along it")
    lower = np.array([joints[number].lower for number in pair])
    if not np.isfinite(lower).all():
        raise PluginError(f"fingers touch at the lower limits of their joints; '{one.name}' or its opposite has none")
    geoms = tuple(
        tuple(i for i, geom in enumerate(world.geoms) if geom.body == joints[number].body and geom.collides)
        for number in pair
    )
    if not all(geoms):
        raise PluginError(f"the fingers of '{one.name}' have no shapes that collide, whose friction would be the pads'")
    side = 1 if way[axis] > 0 else -1
    return Jaw(place, frame, axis, (side, -side), size, force, pair, lower, (geoms[0], geoms[1]))


def add_jaw(spec: Any, hand: Any, number: int, jaw: Jaw, dt: float) -> None:
    """Add the pads of a jaw to the proxy of its hand, with what drives them."""
    stiffness = STIFFNESS * MASS / dt**2
    half = np.array(jaw.size) / 2
    for end, side in enumerate(jaw.sides):
        out = np.zeros(3)
        out[jaw.axis] = side
        name = f"pad {number} {end}"
        pad = hand.add_body(name=name, pos=jaw.frame.position, quat=wxyz_from_xyzw(np.array(jaw.frame.quaternion)))
        pad.gravcomp, pad.explicitinertial = 1.0, True
        pad.mass, pad.inertia = MASS, MASS * 1e-4 * np.ones(3)
        joint = pad.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=out, range=[0.0, 1.0])
        joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        joint.solref_limit, joint.solimp_limit = [2 * dt, 1.0], RUBBER["solimp"]
        rubber = pad.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=out * half)
        rubber.contype, rubber.conaffinity, rubber.priority = 1, 0, 1
        rubber.solref, rubber.solimp = [RUBBER["solref"][0] * dt, 1.0], RUBBER["solimp"]
        drive = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.set_to_position(kp=stiffness, kv=2 * np.sqrt(stiffness * MASS))
        drive.forcelimited, drive.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, [-jaw.force, jaw.force]
    both = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT, name=f"jaw {number}")
    both.name1, both.name2 = f"pad {number} 0", f"pad {number} 1"
    both.data[:5] = [0.0, 1.0, 0.0, 0.0, 0.0]
    both.solref, both.solimp = [2 * dt, 1.0], RUBBER["solimp"]


class Jaws:
    """The jaws in the model of one env."""

    def __init__(self, model: Any, jaws: Sequence[Jaw], friction: float) -> None:
        """`friction` is that of the cloth; the larger of the two coefficients acts."""
        self._jaws, self._model, self._friction = jaws, model, friction

        def pairs(number_of: Callable[[str], int]) -> Array:
            found = [[number_of(f"pad {number} {end}") for end in range(2)] for number in range(len(jaws))]
            return np.array(found, dtype=np.intp).reshape(-1, 2)

        self._joints, self._geoms = pairs(lambda name: model.joint(name).id), pairs(lambda name: model.geom(name).id)
        self._drives = pairs(lambda name: model.actuator(name).id)
        self._rows, self._dofs = model.jnt_qposadr[self._joints], model.jnt_dofadr[self._joints]
        self._pairs = np.array([model.equality(f"jaw {number}").id for number in range(len(jaws))], dtype=np.intp)
        self._hands = np.array([model.body(f"met {jaw.place}").id for jaw in jaws], dtype=np.intp)
        self._preload = np.array([jaw.force for jaw in jaws]) / (STIFFNESS * MASS / model.opt.timestep**2)

    def begin(self, data: Any, openings: Array) -> None:
        """Put the pads (J, 2) [m] from the middle."""
        data.qpos[self._rows] = data.ctrl[self._drives] = openings

    def drive(self, data: Any, openings: Array, closed: Array, friction: Array, duration: float) -> None:
        """Have pads go (J, 2) [m] from the middle, or press, where closed (J,) bool, for so long [s].

        `friction` (G,) of the World's geoms.
        """
        most, before = SPEED * duration, data.ctrl[self._drives]
        goal = openings - np.where(closed, self._preload, 0.0)[:, None]
        data.ctrl[self._drives] = np.clip(goal, before - most, before + most)
        self._model.eq_data[self._pairs, 0] = openings[:, 0] - openings[:, 1]
        for ids, jaw in zip(self._geoms, self._jaws, strict=True):
            for geom, rubber in zip(ids, jaw.geoms, strict=True):
                self._model.geom_friction[geom, 0] = max(friction[list(rubber)].max(), self._friction)

    def pressed(self, data: Any) -> list[PadContact]:
        """What each presses on, in the last substep."""
        geoms, first = data.contact.geom, data.contact.efc_address
        found = []
        for number, (pads, joints, hand) in enumerate(zip(self._geoms, self._joints, self._hands, strict=True)):
            force, touching = np.zeros(2), []
            for end, (pad, joint) in enumerate(zip(pads, joints, strict=True)):
                rows = np.flatnonzero((geoms == pad).any(axis=1) & (first >= 0))
                pushes = data.efc_force[first[rows, None] + np.arange(3)]
                away = np.where(geoms[rows, 0] == pad, -1.0, 1.0)  # contact forces act on the second of two
                along = data.contact.frame[rows].reshape(-1, 3, 3) @ data.xaxis[joint]
                force[end] = (away[:, None] * pushes * along).sum()
                touching.append(rows[pushes[:, 0] > 0])
            pose = np.concatenate([data.xpos[hand], xyzw_from_wxyz(data.xquat[hand])])
            resting = bool(np.abs(data.qvel[self._dofs[number]]).max() < RESTING)
            rows = np.concatenate(touching)
            faces, places = data.contact.elem[rows].max(axis=1), data.contact.pos[rows].copy()
            gap = float(data.qpos[self._rows[number]].sum())
            found.append(PadContact(force, faces, places, pose, gap, resting))
        return found
