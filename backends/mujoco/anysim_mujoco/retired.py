"""Entities that are not there: they stay in the model where the World puts them, and nothing meets them.

Their geoms collide with nothing and are in no group that is drawn or hit by rays, and their couplings are off. What
falls or swings unseen in a step is put back after it. What is there moves with the same bits whatever they do: each
tree is an island of its own for the solver. (Compensating their gravity would hold them still, but the number of bodies
with compensated gravity is one of the sizes by which MuJoCo refuses to copy an env's model.)
"""

from typing import Any

import mujoco
import numpy as np

from anysim.conventions import Array
from anysim.model.world import World
from anysim_mujoco.geoms import UNSEEN
from anysim_mujoco.layout import Layout
from anysim_mujoco.parameters import Parameters


class Retired:
    """What is absent in each env. Made for worlds in which something may be; the others pay nothing."""

    def __init__(self, batch: Any, world: World, layout: Layout, parameters: Parameters) -> None:
        self._batch, self._parameters = batch, parameters
        model = batch.model
        self._built = {name: np.array(getattr(model, name)) for name in ("geom_group", "geom_contype")}
        # indices into the World's entities, -1 for what belongs to none
        entity = np.array([*world.body_entity, -1], dtype=int)[layout.world_body]
        self._geom = entity[model.geom_bodyid]
        self._dof = entity[model.dof_bodyid]
        self._q = np.full(model.nq, -1)
        for joint in range(model.njnt):
            first = model.jnt_qposadr[joint]
            size = 7 if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE else 1
            self._q[first : first + size] = entity[model.jnt_bodyid[joint]]
        self._coupling = entity[_coupled(model)]  # (neq, 2)
        self._qpos, self._qvel, self._warm = (batch.bind(name) for name in ("qpos", "qvel", "qacc_warmstart"))
        self._active = batch.bind("eq_active")
        self._rest = np.array(model.qpos0)
        self._rest[layout.joint_q] = [joint.initial for joint in world.joints]
        self._still_q = np.zeros((batch.nsim, model.nq), dtype=bool)
        self._still_v = np.zeros((batch.nsim, model.nv), dtype=bool)
        self._coupled = np.ones((batch.nsim, model.neq))
        self._any = False

    def populate(self, ids: Array, present: Array) -> None:
        """Have in these envs the entities that `present` (E, entities) says, and no others."""
        there = np.concatenate([present, np.ones((len(ids), 1), dtype=bool)], axis=1)  # the last column is for -1
        geom = there[:, self._geom]
        fields = {
            "geom_group": np.where(geom, self._built["geom_group"], UNSEEN),
            "geom_contype": np.where(geom, self._built["geom_contype"], 0),
            "geom_conaffinity": np.where(geom, self._built["geom_contype"], 0),
        }
        self._parameters.place(ids, fields)
        self._still_q[ids], self._still_v[ids] = ~there[:, self._q], ~there[:, self._dof]
        self._any = bool(self._still_v.any())
        self._coupled[ids] = there[:, self._coupling].all(axis=2)

    def uncouple(self, ids: Array) -> None:
        """Switch off the couplings of what is absent, in state rows that were written anew."""
        self._active[ids] = self._coupled[ids]

    def rest(self) -> None:
        """After a step: what is absent is back where it was, at rest."""
        if self._any:
            np.copyto(self._qpos, self._rest, where=self._still_q)
            np.copyto(self._qvel, 0.0, where=self._still_v)
            np.copyto(self._warm, 0.0, where=self._still_v)


def _coupled(model: Any) -> Array:
    """(neq, 2) the bodies at both ends of equalities: of joints, of the first joint of a tendon, or of sites."""
    joint, site, tendon = mujoco.mjtObj.mjOBJ_JOINT, mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtObj.mjOBJ_TENDON
    first = model.wrap_objid[model.tendon_adr] if model.ntendon else np.zeros(0, dtype=int)
    owner = {int(joint): model.jnt_bodyid, int(site): model.site_bodyid, int(tendon): model.jnt_bodyid[first]}
    found = np.zeros((model.neq, 2), dtype=int)
    for e in range(model.neq):
        for side, thing in enumerate((int(model.eq_obj1id[e]), int(model.eq_obj2id[e]))):
            found[e, side] = owner[int(model.eq_objtype[e])][thing] if thing >= 0 else 0
    return found
