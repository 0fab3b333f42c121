"""A world of its own for soft matter, in MuJoCo: the flex, a proxy of each body that it meets, and what is fixed.

Proxies and what is fixed collide with the flex alone. A proxy has the true mass of its body, and starts each step from
what the engine says. One of a body that joints hold is so heavy that it moves as it does.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import mujoco
import numpy as np

from anysim.conventions import WORLD, Array, wxyz_from_xyzw, xyzw_from_wxyz
from anysim.math import pose as P
from anysim.model.world import World
from anysim_mujoco.geoms import add_assets, add_geom
from anysim_soft import kernels
from anysim_soft.kernels import Exchange
from anysim_soft.pinch import Jaw, Jaws, add_jaw
from anysim_soft.surfaces import Surface, Surfaces, loosen

HEAVY = 1e4
"""[kg], [kg m^2] of a body that joints hold."""
STIFF = (0.999, 0.99999, 0.001, 0.5, 2.0)
"""Impedance of what holds a rope together, or matter at a body."""
GRIP = (0.95, 0.99, 0.001, 0.5, 2.0)
"""The same of what holds cloth for a while."""
AWAY = -1e4
"""[m] height of the proxy of a body that is not there."""
STATE = mujoco.mjtState.mjSTATE_INTEGRATION
FAULTY = mujoco.__version__.startswith("3.")
"""Contacts of quadratic elements, and elastic constants of sheets, are wrong, and are put right."""
_DENSE = (np.zeros(0, dtype=np.int32),) * 3


class FlexSource(NamedTuple):
    """A flex, written for MuJoCo, and what is changed in it.

    Attributes:
        xml: the element.
        fixed: (V,) bool of its nodes, those that do not move.
        mass: (V,) [kg] of its nodes; empty where the element says it.
        options: attributes of `option`.
        sides: (V,) bool by name, the nodes there that bodies hold.
        adjust: changes the model once it is made.
        start: (V, 3) [m] where points begin, if they are not stress-free there.
        inner: forces (V, 3) [N] of its points on each other that the solver does not know, from the env whose memory
            they may read and change, and their places and velocities (V, 3), once a step of the solver.
    """

    xml: str
    fixed: Array
    mass: Array
    options: Mapping[str, object]
    sides: Mapping[str, Array] = MappingProxyType({})
    adjust: Callable[[Any], None] | None = None
    start: Array | None = None
    inner: Callable[[int, Array, Array], Array] | None = None


class Joint(NamedTuple):
    """A node that a body holds: its number, the body's place in `met`, and where in the body's frame, (3,) [m]."""

    node: int
    place: int
    anchor: Array


class Slots(NamedTuple):
    """What bodies may take hold of while an episode lasts.

    Attributes:
        places: for each connection that can be made the place in `met` of its body.
        silent: places in `met` of bodies that do not touch the flex.
        jaws: pads that pinch it.
    """

    places: Sequence[int] = ()
    silent: frozenset[int] = frozenset()
    jaws: Sequence[Jaw] = ()


NOTHING = Slots()
"""Nothing takes hold of it."""


class ProxyMass(NamedTuple):
    """Bodies that it meets: (K,) [kg], inf where joints hold them, (K, 3) [m] and (K, 6) [kg m^2], body axes."""

    mass: Array
    com: Array
    inertia: Array


class Scenery(NamedTuple):
    """The colliding shapes of a World, sorted by what moves them.

    Attributes:
        world: with these geoms alone.
        met, still: bodies with proxies, and static ones.
        number: for each body of `met`, of `still` and for the world itself, the places of its geoms in `world.geoms`.
        geoms: for each geom of `world` its place in the whole World.
        weightless: (K,) bool.
    """

    world: World
    met: Array
    still: Array
    number: Mapping[int, tuple[int, ...]]
    geoms: Array
    weightless: Array

    @classmethod
    def of(cls, world: World, met: Array) -> "Scenery":
        chosen = [i for i, geom in enumerate(world.geoms) if geom.collides]
        known = set(met.tolist())
        bodies = {world.geoms[i].body for i in chosen}
        still = np.array(sorted(bodies - known - {WORLD}), dtype=np.intp)
        plain = tuple(replace(world.geoms[i], texture="", material="") for i in chosen)
        number = {b: tuple(n for n, i in enumerate(chosen) if world.geoms[i].body == b) for b in {*bodies, WORLD}}
        weightless = np.array([world.bodies[i].gravity_compensation for i in met], dtype=bool)
        return cls(replace(world, geoms=plain), met, still, number, np.array(chosen, dtype=np.intp), weightless)


class SubWorld:
    """The model of one env; all that changes is in the state that is passed in and comes out.

    Attributes:
        nodes: (V,) MuJoCo's bodies.
        mass: (M,) [kg] of those that move.
        faces: (F, 3) of its surface.
        state_size: numbers of a state.
    """

    def __init__(
        self,
        source: FlexSource,
        scenery: Scenery,
        bodies: ProxyMass,
        joints: Sequence[Joint],
        dt: float,
        gravity: Array,
        slots: Slots = NOTHING,
        surfaces: Sequence[Surface] = (),
    ) -> None:
        self.scenery, self.gravity, self.source = scenery, np.array(gravity, dtype=float), source
        self.model = model = _compiled(source, scenery, bodies, joints, slots, surfaces, dt, gravity)
        self.data = mujoco.MjData(model)
        self.held = ~np.isfinite(bodies.mass)
        self.nodes = np.array(_nodes(model), dtype=np.intp)
        self._movable = model.body_dofnum[self.nodes] > 0
        self._moving = self.nodes[self._movable]
        self._dofs = model.body_dofadr[self._moving][:, None] + np.arange(3)
        self.mass = np.array(model.body_mass[self._moving])
        self._axis = np.full(model.nv, -1)
        self._axis[self._dofs] = np.arange(3)
        self._uneven = FAULTY and bool(model.flex_interp[0])
        self._sparse = bool(mujoco.mj_isSparse(model))
        self._pinned = len(self._moving) < len(self.nodes)
        self._outer, self._no_inner = np.zeros((2, len(self._moving), 3))
        k, s = len(scenery.met), len(scenery.still)
        free = [model.body(f"met {i}").jntadr[0] for i in range(k)]
        self._pose = model.jnt_qposadr[free].reshape(k, 1) + np.arange(7)
        self._twist = model.jnt_dofadr[free].reshape(k, 1) + np.arange(6)
        self._mocap = model.body_mocapid[[model.body(f"still {i}").id for i in range(s)]]
        self._proxies = np.array([model.body(f"met {i}").id for i in range(k)], dtype=np.intp)
        self._geoms = np.array([model.geom(f"{i}").id for i in range(len(scenery.geoms))], dtype=np.intp)
        connects = np.flatnonzero(model.eq_type == int(mujoco.mjtEq.mjEQ_CONNECT))
        self._slots = connects[len(connects) - len(slots.places) :]
        self.jaws = Jaws(model, slots.jaws, float(model.flex_friction[0, 0]))
        self.surfaces = Surfaces(model, len(surfaces))
        self.faces = _faces(model)
        self.state_size = int(mujoco.mj_stateSize(model, STATE))

    def beginning(self, openings: Array | None = None) -> Array:
        """The state in which nothing has moved yet, the pads of J jaws (J, 2) [m] from their middle."""
        mujoco.mj_resetData(self.model, self.data)
        if openings is not None:
            self.jaws.begin(self.data, openings)
        if self.source.start is not None:
            first = self.model.jnt_qposadr[self.model.body_jntadr[self._moving]]
            flat = self.model.body_pos[self._moving]
            self.data.qpos[first[:, None] + np.arange(3)] = self.source.start[self._movable] - flat
        return self.state()

    def state(self) -> Array:
        """The state as it is now."""
        state = np.empty(self.state_size)
        self.save(state)
        return state

    def save(self, state: Array) -> None:
        """Write the state as it is now into an array."""
        mujoco.mj_getState(self.model, self.data, state, STATE)

    def take(self, state: Array) -> None:
        """Take up a state; `place` works out where everything is."""
        mujoco.mj_setState(self.model, self.data, state, STATE)

    def load(self, state: Array) -> None:
        """Take up a state, and work out where everything is."""
        self.take(state)
        self.place()

    def place(self) -> None:
        """Where points and bodies are, by the coordinates."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_flex(self.model, self.data)

    def points(self) -> Array:
        """(V, 3) [m] the vertices."""
        return self.data.flexvert_xpos[: self.model.flex_vertnum[0]].copy()

    def node_places(self) -> Array:
        """(V, 3) [m] the nodes."""
        return self.data.xpos[self.nodes].copy()

    def stretch(self, factor: float) -> None:
        """Put nodes that all move to `factor` times their distance from their middle, from the beginning."""
        places = self.node_places()
        rows = self.model.jnt_qposadr[self.model.body_jntadr[self._moving]][:, None] + np.arange(3)
        local = P.rotate_inverse(xyzw_from_wxyz(self.data.xquat[self._moving]), places - places.mean(axis=0))
        self.data.qpos[rows] = (factor - 1.0) * local
        self.place()

    def momentum(self) -> Array:
        """(6,) of the flex, about the world's origin."""
        return kernels.momentum(self.mass, self.data.qvel, self._dofs, self._moving, self.data.xpos)

    def meet(self, pose: Array, twist: Array, still: Array, there: Array, friction: Array) -> None:
        """Put the proxies to poses (K, 7) and twists (K, 6) of their frames, and what stands still to poses (S, 7).

        `there` (K + S,) bool; `friction` (G,) of the World's geoms.
        """
        data = self.data
        kernels.meet(pose, twist, there, AWAY, self._pose, self._twist, data.qpos, data.qvel)
        if len(still):
            data.mocap_pos[self._mocap], data.mocap_quat[self._mocap] = still[:, :3], wxyz_from_xyzw(still[:, 3:])
            data.mocap_pos[self._mocap[~there[len(pose) :]], 2] = AWAY
        self.model.geom_friction[self._geoms, 0] = friction[self.scenery.geoms]

    def hold(self, nodes: Array, anchors: Array, holding: Array) -> None:
        """Which nodes (S,) are held at the slots, where in their bodies' frames (S, 3) [m], and whether (S,) bool."""
        self.model.eq_obj2id[self._slots] = self.nodes[nodes]
        self.model.eq_data[self._slots, :3], self.model.eq_data[self._slots, 3:6] = anchors, 0.0
        self.data.eq_active[self._slots] = holding

    def pulls(self) -> Array:
        """(S, 3) [N] on the body of each slot in the last substep, world axes."""
        data, found = self.data, np.zeros((len(self._slots), 3))
        rows = np.flatnonzero(data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY))
        place = np.full(self.model.neq, -1)
        place[self._slots] = np.arange(len(self._slots))
        rows = rows[place[data.efc_id[rows]] >= 0]
        found[place[data.efc_id[rows[::3]]]] = data.efc_force[rows].reshape(-1, 3)
        return found

    def step(self, substeps: int, drag: float, env: int = 0, push: Array | None = None) -> Exchange:
        """Move on by `substeps` steps from a state that was taken up; `env` is what its inner forces are told.

        `push` (V, 3) [N] is what other matter does to its nodes.
        """
        model, data, h = self.model, self.data, self.model.opt.timestep
        done = Exchange(np.zeros((len(self._pose), 6)), np.zeros(6))
        slower, outer = (1.0 - math.exp(-drag * h)) / h, self._outer
        pushed = inner = self._no_inner if push is None else push[self._movable]
        points, bodies, frames = (
            (self._moving, self._dofs),
            (self._proxies, self._twist),
            (data.xpos, data.xipos, data.xmat),
        )
        for _ in range(substeps):
            mujoco.mj_step1(model, data)  # works out where everything is
            before = self.momentum() if self._pinned else None
            if self.source.inner is not None:
                inner = pushed + self._inner(env)
            kernels.load(data.qvel, self.mass, self._dofs, self.gravity, slower, inner, data.qfrc_applied, outer)
            if self._uneven:
                self._even_contacts()
            mujoco.mj_step2(model, data)
            self.surfaces.account(data, h)
            kernels.account(data.qfrc_constraint, *frames, *bodies, *points, outer, h, self._pinned, done)
            if before is not None:  # what holds it has no force of its own in MuJoCo: it gives what is missing
                mujoco.mj_kinematics(model, data)
                done.received[:] += self.momentum() - before
        self.place()
        data.qfrc_applied[:] = 0.0
        return done

    def _inner(self, env: int) -> Array:
        """(M, 3) [N] of the points on each other, those that move."""
        assert self.source.inner is not None
        velocity, moving = np.zeros((len(self.nodes), 3)), self._movable
        velocity[moving] = self.data.qvel[self._dofs]
        return self.source.inner(env, self.data.xpos[self.nodes], velocity)[moving]

    def _even_contacts(self) -> None:
        """Make the rows of contacts push the flex as much as what it touches.

        Quadratic elements weigh some nodes negatively, and MuJoCo 3 leaves these out of its Jacobian: what is left
        sums up to more than one, and 15 to 20 % of the momentum would come from nowhere. Here it is scaled to one.
        """
        data, kind = self.data, int(mujoco.mjtConstraint.mjCNSTR_CONTACT_ELLIPTIC)
        sparse = (data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind) if self._sparse else _DENSE
        if kernels.even_rows(data.efc_type, kind, *sparse, data.efc_J.reshape(-1), self._axis):
            mujoco.mj_referenceConstraint(self.model, data)


def _nodes(model: Any) -> Array:
    """(V,) the bodies of the flex itself; those of surfaces come after it."""
    return model.flex_nodebodyid if model.flex_interp[0] else model.flex_vertbodyid[: model.flex_vertnum[0]]


def _faces(model: Any) -> Array:
    """(F, 3) int32 triangles of the surface, outward; none of a line."""
    dim = int(model.flex_dim[0])
    if dim == 1:
        return np.zeros((0, 3), dtype=np.int32)
    flat = model.flex_elem[: 3 * model.flex_elemnum[0]] if dim == 2 else model.flex_shell
    return np.array(flat, dtype=np.int32).reshape(-1, 3)


def _compiled(
    source: FlexSource,
    scenery: Scenery,
    bodies: ProxyMass,
    joints: Sequence[Joint],
    slots: Slots,
    surfaces: Sequence[Surface],
    dt: float,
    gravity: Array,
) -> Any:
    options = " ".join(f'{key}="{value}"' for key, value in source.options.items())
    pull = " ".join(repr(float(g)) for g in gravity)
    beside = "".join(surface.xml(number) for number, surface in enumerate(surfaces))
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><compiler alignfree="false" fusestatic="false"/>'
        f'<option timestep="{dt!r}" gravity="{pull}" {options}><flag autoreset="disable"/></option>'
        f"<worldbody>{source.xml}{beside}</worldbody></mujoco>"
    )
    model = spec.compile()
    nodes = _nodes(model)
    loosen(spec, model, surfaces)
    for place, body in enumerate(nodes):
        element = spec.body(model.body(body).name)
        if len(source.mass):
            element.mass = source.mass[place]
        if source.fixed[place]:
            for joint in list(element.joints):
                spec.delete(joint)
    add_assets(spec, scenery.world)
    silent = slots.silent | {joint.place for joint in joints}
    _add_shapes(spec, spec.worldbody, scenery.number.get(WORLD, ()), scenery)
    for place, body in enumerate(scenery.still.tolist()):
        element = spec.worldbody.add_body(name=f"still {place}", mocap=True)
        _add_shapes(spec, element, scenery.number[body], scenery)
    for place, body in enumerate(scenery.met.tolist()):
        held = not np.isfinite(bodies.mass[place])
        compensated = held or bool(scenery.weightless[place])
        element = spec.worldbody.add_body(name=f"met {place}", gravcomp=float(compensated))
        element.add_freejoint()
        element.explicitinertial, element.ipos = True, bodies.com[place]
        element.mass = HEAVY if held else bodies.mass[place]
        moments = np.array([HEAVY] * 3 + [0.0] * 3) if held else bodies.inertia[place]
        element.fullinertia = moments
        _add_shapes(spec, element, scenery.number[body], scenery, touches=place not in silent)
        for number, jaw in enumerate(slots.jaws):
            if jaw.place == place:
                add_jaw(spec, element, number, jaw, dt)
    names = [model.body(body).name for body in nodes]
    held = [(joint.place, joint.node, True) for joint in joints] + [(place, 0, False) for place in slots.places]
    for place, node, active in held:
        element = spec.add_equality(type=mujoco.mjtEq.mjEQ_CONNECT, objtype=mujoco.mjtObj.mjOBJ_BODY, active=active)
        element.name1, element.name2 = f"met {place}", names[node]
        element.solref, element.solimp = [2 * dt, 1.0], STIFF if active else GRIP
    made = spec.compile()
    for row, joint in zip(np.flatnonzero(made.eq_type == mujoco.mjtEq.mjEQ_CONNECT), joints, strict=False):
        made.eq_data[row, :3], made.eq_data[row, 3:6] = joint.anchor, 0.0
    if source.adjust is not None:
        source.adjust(made)
    return made


def _add_shapes(spec: Any, owner: Any, numbers: Iterable[int], scenery: Scenery, *, touches: bool = True) -> None:
    """Add shapes of the World to a body; what holds the flex does not touch it."""
    for number in numbers:
        element = add_geom(spec, owner, scenery.world.geoms[number], scenery.world)
        element.name, element.material = f"{number}", ""
        element.contype, element.conaffinity, element.priority = int(touches), 0, 0
