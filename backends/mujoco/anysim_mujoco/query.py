"""Rays and contact points, asked of the present state."""

from typing import Any

import mujoco
import numpy as np

from anysim.conventions import Array
from anysim.engine.state import ContactPoints, RayHits
from anysim_mujoco.geoms import COLLIDING_GROUPS
from anysim_mujoco.layout import Layout
from anysim_mujoco.parameters import Parameters


class Queries:
    """Answers from a scratch MjData that stands in for one env after the other."""

    def __init__(self, batch: Any, layout: Layout, parameters: Parameters) -> None:
        self._batch, self._layout, self._parameters = batch, layout, parameters
        self._model: Any = None
        self._data: Any = None
        groups = np.zeros(mujoco.mjNGROUP, dtype=np.uint8)
        groups[list(COLLIDING_GROUPS)] = 1
        self._groups = groups

    def raycast(self, origins: Array, directions: Array, ids: Array) -> RayHits:
        """First hits with collision geometry; meshes are hit at their triangles."""
        order = np.argsort(ids)
        distance, geom = self._batch.ray(origins[order], directions[order], geomgroup=self._groups, ids=ids[order])
        entity = np.where(geom < 0, -1, self._layout.geom_entity[geom])
        back = np.argsort(order)
        return RayHits(np.where(geom < 0, np.inf, distance)[back], entity[back])

    def model(self, index: int) -> Any:
        """The model of one env, until the next call."""
        if self._model is None:
            self._model = self._batch.get_model(0)
        if self._parameters.per_env:
            self._batch.get_model(index, self._model)
        return self._model

    def env(self, index: int) -> tuple[Any, Any]:
        """Model and data of one env; the data holds the state and nothing derived."""
        if self._data is None:
            self._data = mujoco.MjData(self._batch.model)
        self._batch.get_data(index, self._data)
        return self.model(index), self._data

    def contacts(self, ids: Array) -> ContactPoints:
        """Contacts that exert force, with the force the solver finds for the present controls."""
        return ContactPoints.joined([self._contacts_of(int(index)) for index in ids])

    def _contacts_of(self, index: int) -> list[Array]:
        model, data = self.env(index)
        mujoco.mj_forward(model, data)
        contact = data.contact
        chosen = np.flatnonzero(contact.efc_address >= 0) if data.ncon else np.zeros(0, dtype=int)
        if not len(chosen):
            return list(ContactPoints.joined([]))
        bodies = self._layout.world_body[model.geom_bodyid[contact.geom[chosen]]]
        frames = contact.frame[chosen].reshape(-1, 3, 3)  # rows: normal from the first geom to the second, tangents
        local = np.zeros(6)
        force = np.empty((len(chosen), 3))
        for row, number in enumerate(chosen):
            mujoco.mj_contactForce(model, data, int(number), local)
            force[row] = local[0] * frames[row, 0] + local[1] * frames[row, 1] + local[2] * frames[row, 2]
        return [
            np.full(len(chosen), index),
            bodies[:, 0],
            bodies[:, 1],
            contact.pos[chosen].copy(),
            frames[:, 0].copy(),
            force,
            -contact.dist[chosen],
        ]
