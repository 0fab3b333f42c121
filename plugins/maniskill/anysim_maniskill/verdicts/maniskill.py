"""Verdicts of ManiSkill: the `evaluate` of its environments, called on the arrays of a sketch.

No simulator of ManiSkill's runs: what `evaluate` reads of its env stands in a namespace. Its quaternions are wxyz.
"""

from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import PluginError
from anysim.math import pose as P
from anysim_maniskill.verdicts.sketch import Sketch

PRESS = "press"
"""The note of a sketch that says with what force [N] each finger presses on the first object, (N,)."""


def _peer(module: str, name: str) -> Any:
    try:
        return getattr(import_module(f"mani_skill.{module}"), name)
    except ImportError as error:
        raise PluginError(
            f"verdicts of ManiSkill need mani_skill and torch ({error}): pip install 'anysim-maniskill[maniskill]', "
            "best in an environment of its own"
        ) from None


def _env(module: str, name: str) -> Any:
    return _peer(f"envs.tasks.{module}", name)


def _tensor(values: Array) -> Any:
    import torch  # pyright: ignore[reportMissingImports]

    return torch.as_tensor(np.ascontiguousarray(values, dtype=np.float64))


def _pose(pose: Array) -> Any:
    return _peer("utils.structs.pose", "Pose")(raw_pose=_tensor(pose[:, [0, 1, 2, 6, 3, 4, 5]]))


def _actor(sketch: Sketch, frame: str, pose: Array | None = None) -> Any:
    """What ManiSkill knows of a thing: its pose, velocities and whether it is static."""
    kind, twist = _peer("utils.structs.actor", "Actor"), sketch.twist(frame)
    actor = SimpleNamespace(
        pose=_pose(sketch.pose(frame) if pose is None else pose),
        linear_velocity=_tensor(twist[:, :3]),
        angular_velocity=_tensor(twist[:, 3:]),
    )
    actor.is_static = lambda **thresholds: kind.is_static(actor, **thresholds)
    return actor


def _agent(sketch: Sketch) -> Any:
    """The Panda with its own rules of being at rest and of grasping, from joint velocities and finger forces."""
    kind = _peer("agents.robots.panda.panda", "Panda")
    press = sketch.notes.get(PRESS, np.zeros(sketch.num_states))
    outward = {"left": (0.0, 1.0, 0.0), "right": (0.0, -1.0, 0.0)}
    fingers: list[Any] = []
    for side, axis in outward.items():
        pose = sketch.pose(f"panda.panda_{side}finger")
        force = press[:, None] * P.rotate(pose[:, 3:], np.tile(axis, (len(pose), 1)))
        fingers.append(SimpleNamespace(pose=_pose(pose), force=_tensor(force).float()))  # its matrices are
    agent = SimpleNamespace(
        robot=SimpleNamespace(get_qvel=lambda: _tensor(sketch.joint_velocities("panda"))),
        finger1_link=fingers[0],
        finger2_link=fingers[1],
        scene=SimpleNamespace(get_pairwise_contact_forces=lambda finger, _: finger.force),
    )
    agent.is_static = lambda threshold: kind.is_static(agent, threshold)
    agent.is_grasping = lambda thing: kind.is_grasping(agent, thing)
    return agent


def _said(env: Any, **read: Any) -> Array:
    """The success (N,) that the `evaluate` of a class says of what it reads."""
    seen = SimpleNamespace(**read)
    own: dict[str, Any] = vars(env)
    if "peg_head_pose" in own:
        seen.peg_head_pose = own["peg_head_pose"].fget(seen)
    for name in {"has_peg_inserted", "_compute_distance"} & own.keys():
        setattr(seen, name, own[name].__get__(seen))
    return np.asarray(env.evaluate(seen)["success"]).reshape(-1).astype(bool)


def pick_cube(sketch: Sketch) -> Array:
    """PickCube-v1 with the Panda."""
    env = _env("tabletop.pick_cube", "PickCubeEnv")
    parts = {"goal_site": _actor(sketch, "goal"), "cube": _actor(sketch, "cube"), "agent": _agent(sketch)}
    return _said(env, goal_thresh=env.goal_thresh, **parts)


def push_cube(sketch: Sketch) -> Array:
    """PushCube-v1; its table is at height 0, so that heights are told from ours."""
    env = _env("tabletop.push_cube", "PushCubeEnv")
    cube = sketch.pose("cube")
    cube[:, 2] -= sketch.pose("goal")[:, 2] - env.cube_half_size
    parts = {"obj": _actor(sketch, "cube", cube), "goal_region": _actor(sketch, "goal")}
    return _said(env, goal_radius=env.goal_radius, cube_half_size=env.cube_half_size, **parts)


def stack_cube(sketch: Sketch) -> Array:
    """StackCube-v1."""
    half = _tensor(np.full(3, 0.02))
    parts = {"cubeA": _actor(sketch, "cube"), "cubeB": _actor(sketch, "base"), "agent": _agent(sketch)}
    return _said(_env("tabletop.stack_cube", "StackCubeEnv"), cube_half_size=half, **parts)


def stack_pyramid(sketch: Sketch) -> Array:
    """StackPyramid-v1: A and B side by side, C on top of both."""
    half = _tensor(np.full(3, 0.02))
    cubes = {"cubeA": "beside", "cubeB": "base", "cubeC": "top"}
    parts = {name: _actor(sketch, ours) for name, ours in cubes.items()}
    env = _env("tabletop.stack_pyramid", "StackPyramidEnv")
    return _said(env, cube_half_size=half, agent=_agent(sketch), **parts)


def place_sphere(sketch: Sketch) -> Array:
    """PlaceSphere-v1; its bin's frame is in the middle of the bottom, ours on top of it."""
    env = _env("tabletop.place_sphere", "PlaceSphereEnv")
    middle = sketch.pose("bin.inside")
    middle[:, 2] -= env.block_half_size[0]
    parts = {"obj": _actor(sketch, "ball"), "bin": _actor(sketch, "bin.inside", middle), "agent": _agent(sketch)}
    return _said(env, radius=env.radius, block_half_size=env.block_half_size, **parts)


def peg_insertion(sketch: Sketch) -> Array:
    """PegInsertionSide-v1: its hole is horizontal and entered along x, ours is vertical and entered along -z."""
    env = _env("tabletop.peg_insertion_side", "PegInsertionSideEnv")
    down = P.pose((0.0, 0.0, 0.0), (0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)))[None]
    hole, tip = (_pose(P.compose(sketch.pose(frame), down)) for frame in ("block.hole", "peg.tip"))
    radii = _tensor(np.full(sketch.num_states, 0.015 + vars(env)["_clearance"]))
    here = _pose(np.tile([0, 0, 0, 0, 0, 0, 1.0], (sketch.num_states, 1)))
    return _said(env, box_hole_pose=hole, peg=SimpleNamespace(pose=tip), peg_head_offsets=here, box_hole_radii=radii)


def plug_charger(sketch: Sketch) -> Array:
    """PlugCharger-v1: the charger's frame against its goal, which is where the plug's tip meets the hole."""
    parts = {"charger": _actor(sketch, "charger.tip"), "goal_pose": _pose(sketch.pose("socket.hole"))}
    return _said(_env("tabletop.plug_charger", "PlugChargerEnv"), **parts)


def turn_faucet(sketch: Sketch) -> Array:
    """TurnFaucet-v1; the target is worked out from the lever's limits as it does when it loads a faucet."""
    closed, opened = sketch.joint_ends("faucet.lever")
    target = _tensor(np.full(sketch.num_states, closed + 0.9 * (opened - closed)))
    angle = _tensor(sketch.joint_position("faucet.lever"))
    return _said(_env("tabletop.turn_faucet", "TurnFaucetEnv"), target_angle=target, current_angle=angle)


def open_drawer(sketch: Sketch) -> Array:
    """OpenCabinetDrawer-v1; the target is worked out from the drawer's limits as it does when it loads a cabinet."""
    env = _env("mobile_manipulation.open_cabinet_drawer", "OpenCabinetDrawerEnv")
    closed, opened = sketch.joint_ends("cabinet.drawer_1")
    link = _actor(sketch, "cabinet.drawer_1.handle")
    link.joint = SimpleNamespace(qpos=_tensor(sketch.joint_position("cabinet.drawer_1")))
    target = _tensor(np.full(sketch.num_states, closed + env.min_open_frac * (opened - closed)))
    return _said(env, handle_link=link, target_qpos=target, handle_link_positions=lambda: None)
