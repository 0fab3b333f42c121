"""Live editing rebuilds the model. These rows carry what the solver remembers, so that the rest goes on bit for bit."""

from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.model.index import paired
from anysim.model.world import World
from anysim_mujoco.layout import Layout
from anysim_mujoco.parameters import Parameters
from anysim_mujoco.state import StateReader


class CarriedRows(NamedTuple):
    """Copies in the order of the old World. Dof values are position, velocity and warm start."""

    time: Array
    joints: tuple[Array, ...]
    free: tuple[Array, ...]
    mocap: Array
    effort: Array
    contact: Array
    fault: Array
    inertia: dict[str, Array]


def _dofs(batch: Any, q: Array, v: Array) -> tuple[Array, ...]:
    return batch.bind("qpos")[:, q], batch.bind("qvel")[:, v], batch.bind("qacc_warmstart")[:, v]


def carried_rows(batch: Any, layout: Layout, reader: StateReader, parameters: Parameters) -> CarriedRows:
    """Copy what a rebuild would lose."""
    poses = np.concatenate([batch.bind("mocap_pos"), batch.bind("mocap_quat")], axis=-1)
    return CarriedRows(
        time=batch.bind("time").copy(),
        joints=_dofs(batch, layout.joint_q, layout.joint_v),
        free=_dofs(batch, layout.free_q, layout.free_v),
        mocap=poses[:, layout.mocap],
        effort=reader.joint_effort(),
        contact=reader.contact_force(),
        fault=reader.fault(),
        inertia=parameters.rows(np.arange(batch.nsim)),
    )


def _shared_rows(before: Array, after: Array, old_rows: Array, new_rows: Array) -> tuple[Array, Array]:
    """Of the bodies in both worlds, the rows of those of one kind in both."""
    old, new = old_rows[before], new_rows[after]
    both = (old >= 0) & (new >= 0)
    return old[both], new[both]


def take_rows(
    carried: CarriedRows,
    old: World,
    old_layout: Layout,
    new: World,
    batch: Any,
    layout: Layout,
    reader: StateReader,
    parameters: Parameters,
) -> None:
    """Write what `carried_rows` of the old build copied to where it is now."""
    names = ("qpos", "qvel", "qacc_warmstart")
    batch.bind("time")[:] = carried.time
    bodies = paired(old, new, "bodies")
    before, after = paired(old, new, "joints")
    effort = np.zeros((batch.nsim, len(new.joints)))
    effort[:, after] = carried.effort[:, before]
    for name, values in zip(names, carried.joints, strict=True):
        columns = layout.joint_q if name == "qpos" else layout.joint_v
        batch.bind(name)[:, columns[after]] = values[:, before]
    before, after = _shared_rows(*bodies, old_layout.free_row, layout.free_row)
    for name, values in zip(names, carried.free, strict=True):
        columns = layout.free_q if name == "qpos" else layout.free_v
        batch.bind(name)[:, columns[after]] = values[:, before]
    before, after = _shared_rows(*bodies, old_layout.static_row, layout.static_row)
    batch.bind("mocap_pos")[:, layout.mocap[after]] = carried.mocap[:, before, :3]
    batch.bind("mocap_quat")[:, layout.mocap[after]] = carried.mocap[:, before, 3:]
    before, after = paired(old, new, "contact_sensors")
    contact = np.zeros((batch.nsim, len(new.contact_sensors), 3))
    contact[:, after] = carried.contact[:, before]
    everyone = np.arange(batch.nsim)
    if carried.inertia:
        rows = {name: values[:, bodies[0]] for name, values in carried.inertia.items()}
        parameters.restore_rows(everyone, rows, bodies[1])
    reader.failed[:] = carried.fault
    reader.hold(everyone, effort, contact)
