"""The environment stream of a trajectory as WorldStates: any recorded step can be gone on from, on any engine."""

from typing import Any

import numpy as np

from anysim.engine.control import Control
from anysim.engine.world_state import WorldState
from anysim.errors import RecordError, listing
from anysim.record.reader import TrajectoryReader

_MOTION = ("body_pose", "body_twist", "joint_pos", "joint_vel")
_COMMANDS = tuple(f"control_{name}" for name in Control._fields if name != "mode")


def world_state(reader: TrajectoryReader, step: int) -> WorldState:
    """One env after a control step; step 0 is right after the reset.

    A recording holds motions and position commands. What was drawn, such as a mass, is in its manifest: reset an env
    with its episode seed before this state is written into it.

    Raises:
        RecordError: there is no such step, or the recording lacks a state array that this needs.
    """
    layout = reader.manifest.layout
    lacking = [name for name in _MOTION if name not in layout.state]
    if lacking:
        raise RecordError(f"{reader.directory} does not hold {listing(lacking)}, which a world state needs")
    if not 0 <= step <= reader.manifest.steps or (step == 0 and not reader.initial_state):
        first = 0 if reader.initial_state else 1
        raise RecordError(f"{reader.directory} has the steps {first} to {reader.manifest.steps}, not {step}")
    arrays = reader.initial_state if step == 0 else {name: rows[step - 1] for name, rows in reader.states.items()}
    rows = {name: np.array(arrays[name], dtype=float)[None] for name in _MOTION}
    commands: dict[str, Any] = {}
    if "control_position" in layout.state:
        none = np.zeros(len(layout.actuators))
        commands = {name: np.array(arrays.get(name, none), dtype=float)[None] for name in _COMMANDS}
        commands["control_mode"] = np.full((1, len(layout.actuators)), "position")
    time = 0.0 if step == 0 else float(reader.times[step - 1])
    return WorldState(
        time=np.array([time]),
        entities=(),
        present=np.zeros((1, 0), dtype=bool),
        bodies=layout.bodies,
        body_pose=rows["body_pose"],
        body_twist=rows["body_twist"],
        joints=layout.joints,
        joint_pos=rows["joint_pos"],
        joint_vel=rows["joint_vel"],
        actuators=layout.actuators if commands else (),
        **commands,
    )
