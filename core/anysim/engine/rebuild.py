"""Live editing by rebuild: build the new world, and carry over by name all that both worlds have."""

from typing import TYPE_CHECKING

import numpy as np

from anysim.engine.parameters import PARAMETERS, count
from anysim.engine.write import put_bodies, put_joints
from anysim.model.index import paired
from anysim.model.world import BodyKind, World

if TYPE_CHECKING:
    from anysim.engine.base import SimEngine


def carry_over(engine: "SimEngine", world: World) -> None:
    """Replace the engine's world. If the new one cannot be built the old one is built again, with its state."""
    old = engine.world
    all_envs = np.arange(engine.num_envs)
    state, present = engine.get_state(), engine.presence
    body_pose, body_twist = state.body_pose, state.body_twist
    joint_pos, joint_vel = state.joint_pos, state.joint_vel
    ticks, control, rig = engine._ticks, engine._commands.control, engine._rig  # noqa: SLF001
    changed = {name: engine._get_parameter(name) for name in engine._changed}  # noqa: SLF001
    solver = engine._carry_rows()  # noqa: SLF001

    def build(target: World) -> None:
        engine._retire_state()  # noqa: SLF001
        engine._free()  # noqa: SLF001
        engine._install(target)  # noqa: SLF001
        before, after = paired(old, target, "entities")
        rows = engine._presence.entities.copy()  # noqa: SLF001
        rows[:, after] = present[:, before]
        engine._presence.write(all_envs, rows)  # noqa: SLF001
        engine._build(target, engine.num_envs)  # noqa: SLF001
        if engine._presence.varies:  # noqa: SLF001
            engine._populate(all_envs)  # noqa: SLF001
        engine._reset_rows(all_envs)  # noqa: SLF001
        for name, values in changed.items():
            before, after = paired(old, target, PARAMETERS[name].target)
            if count(PARAMETERS[name], target) and len(after):
                engine._set_parameter(name, values[:, before], all_envs, after)  # noqa: SLF001
                engine._changed[name] = None  # noqa: SLF001
        before, after = paired(old, target, "bodies")
        kinds = [target.bodies[i].kind for i in after]
        for kind in (BodyKind.STATIC, BodyKind.FREE):
            chosen = np.array([k is kind for k in kinds], dtype=bool)
            if chosen.any():
                twist = body_twist[:, before[chosen]] if kind is BodyKind.FREE else None
                put_bodies(engine, all_envs, after[chosen], body_pose[:, before[chosen]], twist)
        before, after = paired(old, target, "joints")
        if len(after):
            put_joints(engine, all_envs, after, joint_pos[:, before], joint_vel[:, before])
        before, after = paired(old, target, "actuators")
        for theirs, ours in zip(control, engine._commands.control, strict=True):  # noqa: SLF001
            ours[:, after] = theirs[:, before]
        before, after = paired(old, target, "cameras")
        engine._rig.poses[:, after] = rig.poses[:, before]  # noqa: SLF001
        engine._rig.fov[:, after] = rig.fov[:, before]  # noqa: SLF001
        engine._ticks[:] = ticks  # noqa: SLF001
        engine._take_rows(solver, old)  # noqa: SLF001

    try:
        build(world)
    except BaseException:
        build(old)
        raise
