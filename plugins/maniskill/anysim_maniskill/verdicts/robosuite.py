"""Verdicts of robosuite: the `_check_success` of its environments, called on the arrays of a sketch, state by state.

No simulation of robosuite's runs: what `_check_success` reads of its env stands in a namespace.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import PluginError
from anysim_maniskill.verdicts.maniskill import PRESS
from anysim_maniskill.verdicts.sketch import Sketch

RULE, GRASP = "_check_success", "_check_grasp"
ARM = "right"
REST = 0.0005
"""Faces that are nearer to each other than this touch [m]."""


def _env(module: str, name: str) -> Any:
    try:
        return getattr(import_module(f"robosuite.environments.manipulation.{module}"), name)
    except ImportError as error:
        raise PluginError(
            f"verdicts of robosuite need it ({error}): pip install --no-deps robosuite==1.5.2, and what it names, best "
            "in an environment of its own"
        ) from None


def _success(env: Any, seen: Any) -> bool:
    """What the rule of a class says of what it reads; it is called from within there."""
    return bool(getattr(env, RULE)(seen))


def _each(sketch: Sketch, check: Callable[[int], bool]) -> Array:
    return np.array([check(row) for row in range(sketch.num_states)])


def _robots(tool: Array) -> list[Any]:
    """One robot with one arm; its tool is a site with the number 0."""
    return [SimpleNamespace(arms=[ARM], eef_site_id={ARM: 0}, gripper=[["left pad"], ["right pad"]], tool=tool)]


def _table(sketch: Sketch) -> float:
    """The height of the table's top [m]: the tabletop is 0.4 thick."""
    return float(sketch.pose("table")[0, 2] + 0.2)


def lift(sketch: Sketch) -> Array:
    """Lift."""
    env, cube, table = _env("lift", "Lift"), sketch.pose("cube"), _table(sketch)
    arena = SimpleNamespace(mujoco_arena=SimpleNamespace(table_offset=(0.0, 0.0, table)))

    def check(row: int) -> bool:
        data = SimpleNamespace(body_xpos=cube[row : row + 1, :3])
        return _success(env, SimpleNamespace(sim=SimpleNamespace(data=data), cube_body_id=0, model=arena))

    return _each(sketch, check)


def stack(sketch: Sketch) -> Array:
    """Stack: two boxes with parallel edges touch where their faces do."""
    env, table = _env("stack", "Stack"), _table(sketch)
    upper, lower, tool = (sketch.pose(name)[:, :3] for name in ("cube", "base", "panda.tool"))
    press = sketch.notes[PRESS]

    def check(row: int) -> bool:
        def contact(first: Any, second: Any) -> bool:
            if "base" in (first, second):
                return bool((np.abs(upper[row] - lower[row]) <= 0.04 + REST * np.array([0, 0, 1])).all())
            return bool(press[row] >= 0.5)

        seen = SimpleNamespace(
            cubeA="cube",
            cubeB="base",
            cubeA_body_id=0,
            cubeB_body_id=1,
            table_offset=(0.0, 0.0, table),
            robots=_robots(tool[row]),
            check_contact=contact,
            sim=SimpleNamespace(
                data=SimpleNamespace(body_xpos=np.stack([upper[row], lower[row]]), site_xpos=tool[row : row + 1])
            ),
        )
        setattr(seen, GRASP, lambda gripper, object_geoms: getattr(env, GRASP)(seen, gripper, object_geoms))
        seen.staged_rewards = lambda: env.staged_rewards(seen)
        return _success(env, seen)

    return _each(sketch, check)


def door(sketch: Sketch) -> Array:
    """Door, for the hinge of our cabinet's door."""
    env, angle = _env("door", "Door"), sketch.joint_position("cabinet.door_1")

    def check(row: int) -> bool:
        data = SimpleNamespace(qpos=angle[row : row + 1])
        return _success(env, SimpleNamespace(sim=SimpleNamespace(data=data), hinge_qpos_addr=0))

    return _each(sketch, check)


def nut_assembly(sketch: Sketch) -> Array:
    """NutAssembly with one nut: ours is the peg that goes into a ring, so the tip of the peg stands for its nut."""
    env, table = _env("nut_assembly", "NutAssembly"), _table(sketch)
    nut, ring, tool = (sketch.pose(name)[:, :3] for name in ("peg.tip", "block.hole", "panda.tool"))

    def check(row: int) -> bool:
        data = SimpleNamespace(body_xpos=np.stack([nut[row], ring[row]]), site_xpos=tool[row : row + 1])
        seen = SimpleNamespace(
            nuts=[SimpleNamespace(name="nut")],
            obj_body_id={"nut": 0},
            peg1_body_id=1,
            objects_on_pegs=np.zeros(1),
            robots=_robots(tool[row]),
            single_object_mode=0,
            table_offset=(0.0, 0.0, table),
            sim=SimpleNamespace(data=data),
        )
        seen.on_peg = lambda position, number: env.on_peg(seen, position, number)
        return _success(env, seen)

    return _each(sketch, check)


THINGS: Sequence[str] = ("cube", "can", "ball", "bar")
"""What `tidy_bin` puts away."""


def pick_place(sketch: Sketch) -> Array:
    """PickPlace with four things, all of which go into the one bin of ours: its last, a quarter of its bins."""
    env, size = _env("pick_place", "PickPlace"), np.array([0.22, 0.32])
    things = np.stack([sketch.pose(name)[:, :3] for name in THINGS], axis=1)
    bins, tool = sketch.pose("bin.inside")[:, :3], sketch.pose("panda.tool")[:, :3]

    def check(row: int) -> bool:
        corner = bins[row] - np.array([*size / 2, 0.0])
        seen = SimpleNamespace(
            objects=[SimpleNamespace(name=name) for name in THINGS],
            obj_body_id={name: i for i, name in enumerate(THINGS)},
            objects_in_bins=np.zeros(len(THINGS)),
            robots=_robots(tool[row]),
            single_object_mode=0,
            bin2_pos=corner,
            bin_size=2 * size,
            sim=SimpleNamespace(data=SimpleNamespace(body_xpos=things[row], site_xpos=tool[row : row + 1])),
        )
        seen.not_in_bin = lambda position, _: env.not_in_bin(seen, position, 3)
        return _success(env, seen)

    return _each(sketch, check)
