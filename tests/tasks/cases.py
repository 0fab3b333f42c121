"""The way of each task from the beginning of an episode to its goal, and states beside the goal."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.task.env import TaskEnv
from anysim_avatars.hold import FREE, HELD
from tests.tasks import (
    bench_paths as bench,
    camera_paths as camera,
    garment_paths as garment,
    matter_paths as matter,
    person_paths as person,
)
from tests.tasks.states import failed, level, offset, put, rewarded, seen, set_joint, set_opening


class Case(NamedTuple):
    """A task, its way to the goal, and states beside the goal."""

    path: Callable[[TaskEnv, float], None]
    """Puts the world at a share of the way from the beginning (0) to the goal (1)."""
    wrong: Sequence[Callable[[TaskEnv], None]]
    """Changes of the goal's state, each of which makes it none."""
    unheld: tuple[str, ...] = ("reach",)
    """Rewards for where the hand is, which stays at home on the way."""
    lasting: bool = False
    """The goal is where an episode begins, and has to last; the way to it begins elsewhere."""


def _towards(thing: str, goal: Callable[[TaskEnv], Array]) -> Callable[[TaskEnv, float], None]:
    """An object from where it is to a goal, in a straight line."""
    start: dict[int, Array] = {}

    def path(env: TaskEnv, share: float) -> None:
        if share == 0.0:
            start[id(env)] = seen(env, thing)
        first, last = start[id(env)], goal(env)
        place = first[:, :3] + share * (last[:, :3] - first[:, :3])
        put(env, thing, np.concatenate([place, last[:, 3:]], axis=1))

    return path


def _shifted(thing: str, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Callable[[TaskEnv], None]:
    return lambda env: put(env, thing, offset(seen(env, thing), x, y, z))


def _tilted(thing: str, angle: float) -> Callable[[TaskEnv], None]:
    turn = P.from_roll_pitch_yaw(np.array([angle, 0.0, 0.0]))
    return lambda env: put(env, thing, P.compose(seen(env, thing), np.array([[0.0, 0.0, 0.0, *turn]])))


def _moving(thing: str, speed: float = 0.1) -> Callable[[TaskEnv], None]:
    def push(env: TaskEnv) -> None:
        root, twist = env.engine.index.entity(thing).root, np.zeros((env.num_envs, 1, 6))
        twist[:, 0, 0] = speed
        env.engine.set_body_state(None, twist, None, [root])

    return push


def _in_reach_of_the_hand(thing: str, tool: str = "panda.tool") -> Callable[[TaskEnv, float], None]:
    return _towards(thing, lambda env: seen(env, tool))


def _opening(joint: str, first: float, last: float) -> Callable[[TaskEnv, float], None]:
    return lambda env, share: set_opening(env, joint, first + share * (last - first))


def _tracking(robot: str) -> Callable[[TaskEnv, float], None]:
    return lambda env, share: _walked(env, share, robot)


def _walked(env: TaskEnv, share: float, robot: str) -> None:
    """A whole episode at a share of the commanded velocity, but for its last step, which is the one to be judged."""
    speed, goal = np.zeros((env.num_envs, 1, 6)), env.scene.goals["walk"]
    goal[(goal == 0.0).all(axis=1), 0] = 0.5  # to stand is no way
    ahead = np.concatenate([goal[:, :2], np.zeros((env.num_envs, 1))], axis=1)
    speed[:, 0, :3], speed[:, 0, 5] = share * P.rotate(seen(env, robot)[:, 3:], ahead), share * goal[:, 2]
    env.engine.set_body_state(None, speed, None, [env.engine.index.entity(robot).root])
    for memory in env.scene.memories:
        memory.forget(np.arange(env.num_envs))
    assert env.spec.task is not None
    for step in range(1, env.spec.task.horizon + 1):
        env.scene.elapsed[:] = step
        env.scene.look(None)
        if step < env.spec.task.horizon:
            env.mdp.judge()


def _short(env: TaskEnv) -> None:
    """A step before the end."""
    env.scene.elapsed[:] -= 1


def _reach(env: TaskEnv, share: float) -> None:
    tool = seen(env, "panda.tool")
    env.scene.goals["goal"][:] = offset(tool, x=0.3 * (1.0 - share))
    env.scene.moment += 1


def _before_named(env: TaskEnv) -> Array:
    """Poses of the base 0.8 m before what each env's instruction names, facing it."""
    names, (rows, index) = ("crate", "drum", "stool", "case"), env.scene.drawn["target"]
    places = np.stack([seen(env, name) for name in names])
    which = np.argmax(rows[index], axis=1)
    pose = seen(env, "rover")
    way = places[which, np.arange(env.num_envs), :2] - pose[:, :2]
    yaw = np.arctan2(way[:, 1], way[:, 0])
    pose[:, :2] += way - 0.8 * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    pose[:, 3:] = P.from_roll_pitch_yaw(np.stack([0.0 * yaw, 0.0 * yaw, yaw], axis=1))
    return pose


def _followed(env: TaskEnv, share: float) -> None:
    """So many seconds behind the person, at a distance that becomes that which is to be kept."""
    pose, person = seen(env, "rover"), seen(env, "person")
    pose[:, :2] = person[:, :2] - np.array([3.2 - 1.7 * share, 0.0])
    pose[:, 3:] = [0.0, 0.0, 0.0, 1.0]
    put(env, "rover", pose)
    for memory in env.scene.memories:
        memory.forget(np.arange(env.num_envs))
    for step in (1, 2, 1000):
        env.scene.elapsed[:] = step
        env.scene.look(None)
        if step < 1000:
            env.mdp.judge()


def _off_goal(env: TaskEnv) -> None:
    env.scene.goals["goal"][:, 0] += 0.011
    env.scene.moment += 1


_DRAWER = "cabinet.drawer_1"


def _cap_in_hand(env: TaskEnv) -> None:
    """The jar is where its cap is in the hand, which has not let go of it."""
    pose = seen(env, "jar")
    pose[:, :3] += seen(env, "panda.tool")[:, :3] - seen(env, "jar.cap.handle")[:, :3]
    put(env, "jar", pose)


def _opening_beside_the_hand(env: TaskEnv, share: float) -> None:
    """An open drawer would be at the hand where that begins, so the arm is turned aside."""
    aside = np.full((env.num_envs, 1), 0.8)
    number = [joint.name for joint in env.engine.world.joints].index("robot.joint1")
    env.engine.set_joint_state(aside, np.zeros_like(aside), None, [number])
    set_opening(env, _DRAWER, 0.8 * share)


def _in_drawer(env: TaskEnv) -> Array:
    return level(offset(seen(env, f"{_DRAWER}.inside"), z=0.021), seen(env, "cube"))


_CARRY = _towards("cube", _in_drawer)


def _put_away(env: TaskEnv, share: float) -> None:
    """Open, put in, close: a third of the way each."""
    set_opening(env, _DRAWER, min(3.0 * share, 1.0) if share < 2 / 3 else 3.0 * (1.0 - share))
    if share <= 1 / 3:
        _CARRY(env, 0.0)
    elif share < 2 / 3:
        _CARRY(env, 3.0 * share - 1.0)
    else:
        _CARRY(env, 1.0)


_PEG = Case(
    _towards("peg", lambda env: level(offset(seen(env, "block.hole"), z=0.051), seen(env, "block"))),
    [_shifted("peg", z=0.02), _shifted("peg", x=0.01), _tilted("peg", 0.15), _moving("peg")],
)


def _plugged(height: float) -> Case:
    """A plug whose frame is `height` [m] above the end of its prongs, from its stand to its socket."""
    return Case(
        _towards("charger", lambda env: offset(seen(env, "socket.hole"), z=height)),
        [_shifted("charger", z=0.01), _shifted("charger", x=0.01), _tilted("charger", 0.3)],
    )


_STANDING = np.array([[0.0, 0.0, 0.0, *P.from_roll_pitch_yaw(np.array([0.0, -np.pi / 2, 0.0]))]])
"""The pose of a lying peg that stands up, its head above."""


def _turned(thing: str, angle: float) -> Callable[[TaskEnv], None]:
    turn = np.array([[0.0, 0.0, 0.0, *P.from_roll_pitch_yaw(np.array([0.0, 0.0, angle]))]])
    return lambda env: put(env, thing, P.compose(seen(env, thing), turn))


def _lain(env: TaskEnv) -> None:
    """The peg, down again."""
    put(env, "peg", P.compose(seen(env, "peg"), P.inverse(_STANDING)))


def _rising(robot: str, height: float, angle: float) -> Callable[[TaskEnv, float], None]:
    """A robot that comes up from so far below where it stands [m], leaning aside [rad] less and less."""

    def path(env: TaskEnv, share: float) -> None:
        lean = P.from_roll_pitch_yaw(np.array([angle * (1.0 - share), 0.0, 0.0]))
        here = np.array([[0.0, 0.0, height * share, *lean]])
        put(env, robot, np.repeat(here, env.num_envs, axis=0))

    return path


_POURED = matter.poured(_towards("cup", lambda env: seen(env, "tray")))
_SCOOPED = matter.poured(_towards("scoop", lambda env: seen(env, "bowl")), "sand", "bowl")
_BESIDE = _towards("beside", lambda env: level(seen(env, "spot"), seen(env, "beside")))
_ON_BOTH = _towards("top", lambda env: level(offset(seen(env, "spot"), z=0.04), seen(env, "top")))


def _pyramid(env: TaskEnv, share: float) -> None:
    """The second cube beside the first, then the third between and above them: half of the way each."""
    if share == 0.0:
        _ON_BOTH(env, 0.0)
    _BESIDE(env, min(2.0 * share, 1.0))
    if share == 1.0:
        put(env, "top", level(seen(env, "peak"), seen(env, "top")))
    elif share > 0.5:
        _ON_BOTH(env, 2.0 * share - 1.0)


_LITTER = {"bar": 0.015, "cube": 0.02, "can": 0.03, "ball": 0.025}
"""What is tidied away, and how far above a floor its middle is."""


def _into_bin(number: int, thing: str) -> Callable[[TaskEnv, float], None]:
    side = 0.05 * number - 0.075
    return _towards(thing, lambda env: offset(seen(env, "bin.inside"), x=side, y=-0.08, z=_LITTER[thing]))


_TIDY = [_into_bin(number, thing) for number, thing in enumerate(_LITTER)]


def _tidied(env: TaskEnv, share: float) -> None:
    """One after the other, a quarter of the way each."""
    for number, path in enumerate(_TIDY):
        path(env, min(max(4.0 * share - number, 0.0), 1.0))


def _taken(robot: str, tool: str, thing: str) -> Callable[[TaskEnv, float], None]:
    """The robot to where its tool is where a thing is to be lifted to; then the thing into its hand."""

    def beside(env: TaskEnv) -> Array:
        base = seen(env, robot)
        base[:, :3] += (seen(env, "aloft") - seen(env, f"{robot}.{tool}"))[:, :3]
        return base

    there, up = _towards(robot, beside), _towards(thing, lambda env: seen(env, "aloft"))

    def path(env: TaskEnv, share: float) -> None:
        there(env, min(2.0 * share, 1.0))
        up(env, max(2.0 * share - 1.0, 0.0))

    return path


_PACK = [
    _towards(thing, lambda env, side=side, height=height: offset(seen(env, "crate.inside"), y=side, z=height))
    for thing, side, height in (("bar", -0.1, 0.015), ("cube", 0.0, 0.02), ("can", 0.1, 0.03))
]


def _packed(env: TaskEnv, share: float) -> None:
    """One after the other, a third of the way each."""
    for number, path in enumerate(_PACK):
        path(env, min(max(3.0 * share - number, 0.0), 1.0))


def _roll(env: TaskEnv, share: float, turn: float = 0.0) -> None:
    """The cart a share of the way to the goal, and turned [rad]."""
    way = P.compose(P.inverse(seen(env, "cart")), seen(env, "goal"))[:, :2]
    joints = [env.engine.index.joint(f"cart.{name}") for name in ("along", "aside", "body")]
    places = np.concatenate([share * way, np.full((env.num_envs, 1), turn)], axis=1)
    env.engine.set_joint_state(places, np.zeros_like(places), None, joints)
    env.scene.look(None)


def _bend(env: TaskEnv, angles: Array) -> None:
    """The joints of the rope at angles (N, J) [rad], at rest."""
    numbers = [k for k, joint in enumerate(env.engine.world.joints) if joint.name.startswith("rope.")]
    env.engine.set_joint_state(angles, np.zeros_like(angles), None, numbers)
    env.scene.look(None)


_PULL = _towards("rope", lambda env: level(seen(env, "pull"), np.array([[0, 0, 0, 0, 0, -np.sqrt(0.5), np.sqrt(0.5)]])))


def _straighten(env: TaskEnv, share: float) -> None:
    """All bends become less as the rope goes to its line."""
    _PULL(env, share)
    angles = np.zeros((env.num_envs, 11))
    angles[:, ::2] = 0.2 * (1.0 - share)
    _bend(env, angles)


def _bent(env: TaskEnv) -> None:
    angles = np.zeros((env.num_envs, 11))
    angles[:, 4] = 0.3
    _bend(env, angles)


_TIPS = ("index", "middle", "ring", "thumb")


def _at_tips(env: TaskEnv, share: float) -> None:
    """The goals come to where the finger tips are."""
    for tip in _TIPS:
        env.scene.goals[tip][:] = offset(seen(env, f"hand.{tip}_tip"), x=0.1 * (1.0 - share))
    env.scene.moment += 1


def _off_tip(tip: str) -> Callable[[TaskEnv], None]:
    def off(env: TaskEnv) -> None:
        env.scene.goals[tip][:, 2] += 0.011
        env.scene.moment += 1

    return off


_TO_HAND = _in_reach_of_the_hand("bottle", "robot.tool")


def _to_goal_in_hand(env: TaskEnv, share: float) -> None:
    """The goal is where the hand is, and the bottle goes there."""
    env.scene.goals["goal"][:] = seen(env, "robot.tool")
    env.scene.moment += 1
    _TO_HAND(env, share)


def _turned_cube() -> Callable[[TaskEnv, float], None]:
    """Turns the cube about the vertical, to an angle from where it is at first."""
    start: dict[int, Array] = {}

    def turn(env: TaskEnv, angle: float) -> None:
        base = start.setdefault(id(env), seen(env, "cube"))
        turned = P.from_axis_angle(np.tile([0.0, 0.0, 1.0], (len(base), 1)), np.full(len(base), angle))
        put(env, "cube", np.concatenate([base[:, :3], P.multiply(turned, base[:, 3:])], axis=1))

    return turn


def _spun(
    turn: Callable[[TaskEnv, float], None], angle: float
) -> tuple[Callable[[TaskEnv, float], None], Callable[[TaskEnv], None]]:
    """What turns something to an angle, judged on the way as turns are counted; and turned back by a bit."""
    turned: dict[int, float] = {}

    def path(env: TaskEnv, share: float) -> None:
        now = turned.get(id(env), 0.0)
        for part in np.linspace(now, share * angle, 1 + int(np.ceil(abs(share * angle - now) / 0.5)))[1:]:
            turn(env, float(part))
            env.scene.elapsed += 1
            failed(env), rewarded(env)
        turned[id(env)] = share * angle

    return path, lambda env: path(env, 0.95)


_REORIENT = _spun(_turned_cube(), 6.3)
_VALVE = _spun(lambda env, angle: set_joint(env, "valve.wheel", angle), 3.2)

CASES: dict[str, Case] = {
    "reorient_in_hand": Case(_REORIENT[0], [_REORIENT[1]], ()),
    "rotate_valve": Case(_VALVE[0], [_VALVE[1], lambda env: set_joint(env, "valve.wheel", 3.2, 0.2)]),
    "dex_reach_tips": Case(_at_tips, [_off_tip(tip) for tip in _TIPS], ()),
    "dex_relocate": Case(
        _to_goal_in_hand, [_shifted("bottle", x=0.06), _shifted("bottle", z=-0.06), _moving("bottle")]
    ),
    "rope_straighten": Case(_straighten, [_bent, _shifted("rope", x=0.035), _shifted("rope", y=-0.04)], ()),
    "lift_cube": Case(
        _towards("cube", lambda env: level(offset(seen(env, "goal"), z=0.02), seen(env, "cube"))),
        [_shifted("cube", z=-0.03), _shifted("cube", z=0.5)],
    ),
    "place_sphere": Case(
        _towards("ball", lambda env: offset(seen(env, "bin.inside"), z=0.02)),
        [_shifted("ball", x=0.006), _shifted("ball", z=0.006), _moving("ball")],
    ),
    "stack_pyramid": Case(
        _pyramid, [_shifted("beside", z=0.006), _shifted("top", z=0.006), _shifted("top", y=0.06), _moving("top")], ()
    ),
    "tidy_bin": Case(_tidied, [_shifted("can", x=0.2), _shifted("ball", z=0.15)], ()),
    "bi_dex_lift": Case(
        _towards("tray", lambda env: seen(env, "aloft")),
        [_shifted("tray", z=-0.03), _tilted("tray", 0.35), _moving("tray")],
        ("reach", "reach_too"),
    ),
    "dex_grasp": Case(
        _in_reach_of_the_hand("bottle", "robot.tool"),
        [_shifted("bottle", x=0.13), _shifted("bottle", z=-0.1), _moving("bottle")],
    ),
    "reach": Case(_reach, [_off_goal], ()),
    "push_cube": Case(
        _towards("cube", lambda env: level(seen(env, "goal"), seen(env, "cube"))),
        [_shifted("cube", y=0.11), _shifted("cube", z=0.02), _moving("cube")],
    ),
    "place_on_pad": Case(
        _towards("cube", lambda env: offset(seen(env, "pad"), z=0.019)),
        [_shifted("cube", x=0.05), _shifted("cube", z=0.01), _moving("cube")],
    ),
    "pick_place_wall": Case(
        _towards("cube", lambda env: offset(seen(env, "pad"), z=0.019)),
        [_shifted("cube", x=0.05), _shifted("cube", z=0.01), _moving("cube")],
    ),
    "place_mug": Case(
        _towards("mug", lambda env: level(offset(seen(env, "coaster"), z=-0.001), seen(env, "mug"))),
        [_shifted("mug", x=0.05), _shifted("mug", z=0.01), _tilted("mug", 0.15), _moving("mug")],
    ),
    "stack_cube": Case(
        _towards("cube", lambda env: offset(seen(env, "base"), z=0.04)),
        [_shifted("cube", x=0.04), _shifted("cube", z=0.01), _moving("cube")],
    ),
    "open_drawer": Case(_opening(_DRAWER, 0.0, 0.8), [lambda env: set_opening(env, _DRAWER, 0.7)]),
    "dex_open_drawer": Case(_opening_beside_the_hand, [lambda env: set_opening(env, _DRAWER, 0.7)]),
    "close_drawer": Case(_opening(_DRAWER, 0.7, 0.02), [lambda env: set_opening(env, _DRAWER, 0.1)]),
    "peg_in_hole": _PEG,
    "peg_in_hole_2mm": _PEG,
    "peg_in_hole_1mm": _PEG,
    "press_button": Case(_opening("button.cap", 0.0, 0.9), [lambda env: set_opening(env, "button.cap", 0.7)]),
    "insert_round_peg": _PEG,
    "push_t": Case(_towards("tee", lambda env: seen(env, "goal")), [_shifted("tee", x=0.01), _turned("tee", 0.2)]),
    "pull_cube_tool": Case(
        _towards("cube", lambda env: offset(seen(env, "table"), x=0.1, z=0.22)),
        [_shifted("cube", x=0.3), _shifted("cube", z=0.05)],
    ),
    "lift_peg_upright": Case(
        _towards("peg", lambda env: P.compose(offset(seen(env, "table"), 0.1, -0.25, 0.32), _STANDING)),
        [_shifted("peg", z=0.02), _moving("peg"), _lain],
    ),
    "nut_on_peg": Case(
        _towards("nut", lambda env: offset(seen(env, "post.tip"), z=0.001)),
        [_shifted("nut", z=0.02), _shifted("nut", x=0.015), _moving("nut")],
    ),
    "gear_mesh": Case(
        _towards("gear", lambda env: offset(seen(env, "stand.shaft"), z=0.001)),
        [_shifted("gear", z=0.016), _shifted("gear", x=0.006), _moving("gear")],
    ),
    "peg_insertion_side": Case(
        _towards("peg", lambda env: P.compose(seen(env, "block"), np.array([[-0.06, 0.0, 0.08, 0.0, 0.0, 1.0, 0.0]]))),
        [_shifted("peg", x=-0.05), _shifted("peg", y=0.03)],
    ),
    "turn_faucet": Case(_opening("faucet.lever", 0.0, 0.95), [lambda env: set_opening(env, "faucet.lever", 0.85)]),
    "screw_cap": Case(
        _opening("jar.cap", 0.0, 0.95),
        [
            lambda env: set_opening(env, "jar.cap", 0.88),
            lambda env: set_opening(env, "jar.cap", 0.95, 0.1),
            _cap_in_hand,
        ],
    ),
    "flip_switch": Case(_opening("switch.rocker", 0.0, 0.95), [lambda env: set_opening(env, "switch.rocker", 0.85)]),
    "pour_beads": Case(_POURED, [matter.spill_beads]),
    "hang_towel": Case(garment.freely(garment.over_rail), [garment.shift(y=0.1), garment.take_hold]),
    "spread_towel": Case(garment.freely(garment.spread), garment.HEAPED),
    "fold_towel": Case(garment.freely(garment.folded), [garment.turn_up, garment.take_hold]),
    "flatten_towel": Case(garment.freely(garment.spread, garment.folded), garment.HEAPED),
    "fling_towel": Case(garment.freely(garment.spread, garment.folded), garment.HEAPED, ("reach", "partner_reach")),
    "fold_shirt": Case(garment.freely(garment.shirt_folded), [garment.lay_flat, garment.take_hold]),
    "pour_water": Case(_POURED, [lambda env: matter.spill(env, "water", 0.3)]),
    "plug_charger": _plugged(0.036),
    "usb_insert": _plugged(0.034),
    "unplug_charger": Case(
        _towards("charger", lambda env: offset(seen(env, "socket.mouth"), z=0.1)),
        [_shifted("charger", z=-0.05), _shifted("charger", x=0.1), _moving("charger")],
    ),
    "put_away": Case(
        _put_away, [lambda env: set_opening(env, _DRAWER, 0.2), _shifted("cube", z=0.1), _moving("cube")], ()
    ),
    "lab_vial": Case(bench.start, bench.WRONG, ()),
    "handover": Case(
        _in_reach_of_the_hand("bar", "partner.tool"),
        [lambda env: put(env, "bar", seen(env, "panda.tool")), _shifted("bar", z=-0.25), _moving("bar")],
        ("give",),
    ),
    "nav_to_pose": Case(
        _towards("rover", lambda env: seen(env, "goal")),
        [_shifted("rover", x=0.11), _tilted("rover", 0.15), _moving("rover")],
        (),
    ),
    "nav_to_object": Case(
        _towards("rover", lambda env: _before_named(env)),
        [_shifted("rover", x=2.5), _turned("rover", 0.3), _moving("rover")],
        ("turn",),
    ),
    "follow_person": Case(_followed, [_shifted("rover", x=-1.0), _turned("rover", 0.8)], ()),
    "stop_for_person": Case(
        _towards("rover", lambda env: seen(env, "goal")),
        [_shifted("rover", x=0.11), _turned("rover", 0.2), _moving("rover")],
        (),
    ),
    "walk_to_pose": Case(
        _towards("dog", lambda env: seen(env, "goal")), [_shifted("dog", x=0.27), _turned("dog", 0.4)], ()
    ),
    "loco_reach": Case(
        _towards("dog", lambda env: level(seen(env, "goal"), seen(env, "dog"))), [_shifted("dog", x=0.37)], ()
    ),
    "loco_grasp": Case(
        _taken("dog", "between", "box"),
        [_shifted("box", x=0.05), _shifted("box", z=-0.05), _moving("dog", 0.2)],
        ("walk",),
    ),
    "g1_place_in_bowl": Case(
        _towards("ball", lambda env: offset(seen(env, "bowl.inside"), z=0.042)),
        [
            _shifted("ball", x=0.04),
            _shifted("ball", z=0.02),
            _moving("ball"),
            lambda env: set_joint(env, "g1.right_elbow_joint", 1.0),
        ],
    ),
    "g1_transport_box": Case(
        _towards("box", lambda env: offset(seen(env, "other_table"), z=0.475)),
        [_shifted("box", x=0.4), _shifted("box", z=0.015), _moving("box")],
        ("left", "right"),
    ),
    "loco_open_door": Case(
        _opening("door.leaf", 0.0, 0.18),
        [lambda env: set_opening(env, "door.leaf", 0.12), _tilted("dog", 0.4)],
        ("approach",),
    ),
    "loco_push_box": Case(
        _towards("box", lambda env: seen(env, "goal")),
        [_shifted("box", x=0.16), _tilted("box", 0.6), _moving("box")],
        ("approach",),
    ),
    "loco_room_nav": Case(
        _towards("dog", lambda env: seen(env, "goal")),
        [_shifted("dog", x=0.27), _turned("dog", 0.4), _moving("dog")],
        (),
    ),
    "go1_velocity": Case(_tracking("dog"), [_moving("dog", 9.0), _short], ()),
    "go1_velocity_rough": Case(_tracking("dog"), [_moving("dog", 9.0), _short], ()),
    "g1_velocity": Case(_tracking("walker"), [_moving("walker", 9.0), _short], ()),
    "stand_still": Case(
        _rising("dog", 0.3, 0.6), [_shifted("dog", z=-0.11), _tilted("dog", 0.36)], unheld=(), lasting=True
    ),
    "get_up": Case(
        _rising("dog", 0.3, 0.6), [_shifted("dog", z=-0.06), _tilted("dog", 0.3), _moving("dog", 0.2)], unheld=()
    ),
    "stand_on_two_legs": Case(
        _rising("walker", 0.76, 0.8),
        [_shifted("walker", z=-0.27), _shifted("walker", z=0.25), _tilted("walker", 0.62)],
        unheld=(),
        lasting=True,
    ),
    "mobile_grasp": Case(
        _taken("rover", "tool", "cube"), [_shifted("cube", x=0.04), _moving("rover")], ("drive", "reach")
    ),
    "mobile_pick_place": Case(
        _towards("cube", lambda env: offset(seen(env, "tray.inside"), z=0.021)),
        [_shifted("cube", x=0.1), _moving("cube"), _moving("rover")],
        (),
    ),
    "mobile_open_door": Case(
        _opening("door.leaf", 0.0, 0.18),
        [lambda env: set_opening(env, "door.leaf", 0.12), _moving("rover")],
        ("drive", "reach"),
    ),
    "mobile_open_drawer": Case(
        _opening(_DRAWER, 0.0, 0.8), [lambda env: set_opening(env, _DRAWER, 0.7), _moving("rover")], ("drive", "reach")
    ),
    "pack": Case(_packed, [_shifted("can", y=0.1), _shifted("bar", z=0.1), _moving("crate")], ()),
    "push_cart": Case(_roll, [lambda env: _roll(env, 0.7), lambda env: _roll(env, 1.0, 0.3)]),
    "fetch_from_drawer": Case(
        _towards("cube", lambda env: offset(seen(env, "tray.inside"), z=0.021)),
        [lambda env: set_opening(env, _DRAWER, 0.1), _shifted("cube", x=0.1), _moving("rover")],
        (),
    ),
    "camera_goto": Case(camera.to_goal, [camera.moved(x=0.06), camera.moved(yaw=0.1), camera.drifting], ()),
    "camera_look_at": Case(
        camera.to_view,
        [camera.moved(yaw=0.15), camera.moved(x=0.25), camera.moved(z=-0.5, pitch=-0.7), camera.drifting],
        (),
    ),
    "camera_orbit_scan": Case(
        camera.around, [camera.moved(yaw=0.2), camera.moved(pitch=0.2), camera.drifting], ("scan",)
    ),
    "camera_track_target": Case(camera.tracking, [_short], ()),
    "take_from_human": Case(person.taken, [_shifted("bar", x=0.15), _moving("bar"), person.holding(HELD)], ("touch",)),
    "hand_to_human": Case(
        person.given, [_shifted("bar", z=0.1), _moving("bar"), person.holding(FREE)], ("reach", "touch")
    ),
    "wipe_arm": Case(person.wiped, [person.unwiped], ("wipe", "press")),
    "feed_spoon": Case(person.fed, [_tilted("spoon", 0.3), _shifted("spoon", x=-0.05), _moving("spoon", 0.15)]),
    "cowork_place": Case(
        person.placed, [_shifted("red_cube", x=0.06), _shifted("blue_cube", z=0.05), _moving("red_cube")], ("touch",)
    ),
    "route_cable": Case(matter.routed, [matter.straight, matter.cable_off_goal, matter.take_cable]),
    "scoop_sand": Case(_SCOOPED, [lambda env: matter.spill(env, "sand", 0.95)]),
}
