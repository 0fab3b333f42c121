"""Guesses from the names and the tree of a model. Each is told with what it rests on, so that a person can judge it."""

import re
from math import inf
from typing import NamedTuple

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.compile.builder import WorldBuilder
from anysim.conventions import Array
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.model.world import BodyKind, EntityKind, Joint, JointType, World

FINGER = re.compile(r"finger|gripper|jaw|thumb|index|middle|ring|pinky|little|knuckle|claw|palm_to", re.IGNORECASE)
WHEEL = re.compile(r"wheel|caster|castor", re.IGNORECASE)
LEG = re.compile(r"leg|hip|thigh|calf|knee|ankle|foot|shank|haa|hfe|kfe", re.IGNORECASE)
TOOL = re.compile(r"tcp|tool0?$|tool_|end_?effector|ee_|_ee$|eef|grasp|gripper_link|hand$|flange", re.IGNORECASE)
SIDES = {
    "left": re.compile(r"(^|_)(l|left)(_|$)|left", re.IGNORECASE),
    "right": re.compile(r"(^|_)(r|right)(_|$)|right", re.IGNORECASE),
}
FEET = 0.06
"""[m] or a tenth of the height, whichever is more: how far above the lowest point a foot may be."""


class Leg(NamedTuple):
    """Joints from the body down, and the link at the end."""

    name: str
    joints: tuple[str, ...]
    foot: str


class Guess(NamedTuple):
    """What a model seems to be. Joint names are local; followers are in no channel."""

    floating: bool
    category: str
    wheels: tuple[str, ...]
    legs: tuple[Leg, ...]
    arm: tuple[str, ...]
    eef: tuple[str, ...]
    tool: str | None
    base_height: float
    reasons: tuple[str, ...]
    anchored: tuple[str, ...] = ()
    """Joints by which its first body moves against the world, and which no drive of the file moves."""
    carried: tuple[str, ...] = ()
    """Joints that carry it over the ground, and are driven: slides, and maybe a turn, between an empty root and it."""


def alone(model: ImportedModel, floating: bool) -> World:
    """A World that holds the model and nothing else, as `robot`."""
    builder = WorldBuilder(World(name=model.name))
    builder.add("robot", EntityKind.ROBOT, model, root=BodyKind.FREE if floating else BodyKind.STATIC)
    return builder.build()


def within(value: float, joint: Joint, digits: int) -> float:
    """A position with so many decimals, or as it is where that would be outside of the joint's limits."""
    near = round(float(value), digits)
    return near if joint.lower <= near <= joint.upper else float(value)


def home_of(model: ImportedModel) -> dict[str, float]:
    """Joints that cannot be at zero, or that the source has elsewhere, and where they begin instead."""
    home: dict[str, float] = {}
    for joint in model.joints:
        at = joint.initial
        if not joint.lower <= at <= joint.upper:
            at = (joint.lower + joint.upper) / 2
        if joint.mimic is None and at != 0.0:
            home[joint.name] = within(at, joint, 4)
    return home


def guess(model: ImportedModel) -> Guess:
    """Look at a model."""
    world = alone(model, False)
    reasons: list[str] = []
    driven = [i for i, joint in enumerate(model.joints) if joint.mimic is None]
    chains = _chains(model)
    low = _lowest(world)
    legs = _legs(model, chains, low)
    around, lies = _around(model, chains)
    if len(legs) < len(around):
        legs = around
        reasons.append(f"legs: {len(legs)} alike chains, as many at each corner of the base")
    if lies and len(legs) >= 4:
        reasons.append("legs: y is up in the file, so that it lies on its side here; place it with `roll`: 1.5708")
    rails = _rails(model)
    passive = {j for j in rails if model.actuator_hints and not any(hint.joint == j for hint in model.actuator_hints)}
    names = {i: model.joints[i].name for i in driven if i not in passive}
    in_legs = {joint for leg in legs for joint in leg.joints}
    wheels = [names[i] for i in names if WHEEL.search(names[i]) and _endless(model, i)]
    eef = [n for i, n in names.items() if n not in in_legs and n not in wheels and _is_finger(model, i)]
    slides = [j for j in rails if model.joints[j].type is JointType.PRISMATIC]
    carried = [names[j] for j in rails if j in names] if len(slides) == 2 and len(rails) <= 3 else []
    arm = [n for n in names.values() if n not in {*in_legs, *wheels, *eef, *carried}]
    planted = bool(rails) and not model.bodies[0].inertial.mass
    stands = any(geom.collides for geom in model.geoms)
    floating = model.bodies[0].kind is BodyKind.FREE or (
        (len(legs) >= 2 or len(wheels) >= 2) and not planted and stands
    )
    if not stands and not floating and not planted and (len(legs) >= 2 or len(wheels) >= 2):
        reasons.append("base: fixed; nothing of it collides, and without collision shapes it would fall for ever")
    elif planted and not floating and (passive or len(legs) >= 2 or len(wheels) >= 2):
        how = ", ".join(model.joints[j].name for j in rails)
        reasons.append(f"base: fixed; its first body moves against the world by {how}")
    elif carried and planted:
        reasons.append(f"base: fixed; {', '.join(carried)} between an empty root and its first body carry it")
    elif model.bodies[0].kind is BodyKind.FREE:
        reasons.append("base: floating, as the file has it")
    else:
        why = f"{len(legs)} chains that end near the ground" if len(legs) >= 2 else f"{len(wheels)} wheels"
        reasons.append(
            f"base: floating, because of {why}" if floating else "base: fixed; it has neither legs nor wheels"
        )
    if not floating:
        arm, legs = [n for n in names.values() if n not in {*eef, *wheels, *carried}], []
    height = max(0.0, -float(low)) if floating and np.isfinite(low) else 0.0
    roots = {chain[0] for chain in chains if len(chain) > 1}
    if not floating and not eef and len(roots) >= 3:
        arm, eef = [], arm
        reasons.append(f"a hand, because {len(roots)} chains begin at its base")
    category = _category(legs, [*wheels, *carried], arm, eef)
    tool = _tool(model, arm, eef)
    return Guess(
        floating,
        category,
        tuple(wheels),
        tuple(legs),
        tuple(arm),
        tuple(eef),
        tool,
        round(height, 4),
        tuple(reasons),
        tuple(model.joints[j].name for j in sorted(passive)),
        tuple(carried),
    )


def _endless(model: ImportedModel, joint: int) -> bool:
    return model.joints[joint].upper == inf or model.joints[joint].type is JointType.REVOLUTE


def _is_finger(model: ImportedModel, joint: int) -> bool:
    """By its own name or that of its link; or a slide at the end of a chain, with another beside it."""
    found = model.joints[joint]
    parents = [body.parent for body in model.bodies]
    if FINGER.search(found.name) or (found.body not in parents and FINGER.search(model.bodies[found.body].name)):
        return True
    if found.type is not JointType.PRISMATIC or found.body in parents:
        return False
    beside = [j for j in model.joints if j.type is JointType.PRISMATIC and parents[j.body] == parents[found.body]]
    return len(beside) == 2


def _chains(model: ImportedModel) -> list[list[int]]:
    """For each body without children the joints from the root down to it."""
    parents = [body.parent for body in model.bodies]
    joint_of = {joint.body: i for i, joint in enumerate(model.joints)}
    found = []
    for tip in sorted(set(range(1, len(parents))) - set(parents)):
        chain, body = [], tip
        while body > 0:
            chain.append(joint_of[body])
            body = parents[body]
        found.append(chain[::-1])
    return found


def _shapes(world: World) -> list[tuple[int, Array]]:
    """Lowest corner (3,) of each shape that collides, with its body."""
    meshes = {mesh.name: mesh for mesh in world.meshes}
    poses = world.initial_body_pose
    return [
        (g.body, shape_bounds(g.shape, P.compose(poses[g.body], P.pose(g.position, g.quaternion)), meshes)[0])
        for g in world.geoms
        if g.collides
    ]


def _lowest(world: World) -> float:
    """[m] below the base, at the initial joint positions; inf without shapes."""
    return min((float(corner[2]) for _, corner in _shapes(world)), default=inf)


def _legs(model: ImportedModel, chains: list[list[int]], low: float) -> list[Leg]:
    """Chains of two joints and more without wheels whose end is as low as anything is, and that are named like legs."""
    world = alone(model, False)
    slack = max(FEET, 0.1 * abs(low)) if np.isfinite(low) else 0.0
    down: dict[int, float] = {}
    for body, corner in _shapes(world):
        down[body] = min(down.get(body, inf), float(corner[2]))
    found: list[Leg] = []
    for chain in chains:
        tip = model.joints[chain[-1]].body
        names = [model.joints[i].name for i in chain if model.joints[i].mimic is None]
        words = [*names, model.bodies[tip].name]
        if len(names) < 2 or any(WHEEL.search(w) or FINGER.search(w) for w in words):
            continue
        if down.get(tip, inf) <= low + slack and any(LEG.search(w) for w in words):
            found.append(Leg(_leg_name(words[0], len(found)), tuple(names), _foot(model, tip)))
    if len({leg.name for leg in found}) < len(found):
        found = [leg._replace(name=f"leg_{i}") for i, leg in enumerate(found)]
    return found


def _around(model: ImportedModel, chains: list[list[int]]) -> tuple[list[Leg], bool]:
    """Chains of two joints and more of one length, as many in each of the four corners about their middle: legs.

    And whether these corners are about the y axis, not about z.
    """
    length = max((len(chain) for chain in chains), key=[len(chain) for chain in chains].count, default=0)
    chains = [chain for chain in chains if len(chain) == length]
    words = [model.joints[i].name for chain in chains for i in chain]
    if (
        length < 2
        or len(chains) % 4
        or len({chain[0] for chain in chains}) < len(chains)
        or any(map(FINGER.search, words))
    ):
        return [], False
    begin = np.array([model.bodies[model.joints[chain[0]].body].position for chain in chains])
    for plane in ([0, 1], [0, 2]):
        side = np.sign((begin - begin.mean(axis=0))[:, plane].round(4))
        corners = [tuple(one) for one in side.tolist()]
        if all(corners.count((x, y)) * 4 == len(chains) for x in (1.0, -1.0) for y in (1.0, -1.0)):
            break
    else:
        return [], False
    tips = [model.joints[chain[-1]].body for chain in chains]
    joints = [tuple(model.joints[i].name for i in chain if model.joints[i].mimic is None) for chain in chains]
    pairs = enumerate(zip(joints, tips, strict=True))
    return [Leg(f"leg_{i}", own, _foot(model, tip)) for i, (own, tip) in pairs if own], plane == [0, 2]


def _rails(model: ImportedModel) -> list[int]:
    """The joints between a root that is nothing but a place in the world, and the first body with a shape."""
    shaped, parents = {geom.body for geom in model.geoms}, [body.parent for body in model.bodies]
    found, body = [], 0
    while body not in shaped and parents.count(body) == 1:
        body = parents.index(body)
        found.append(next(i for i, joint in enumerate(model.joints) if joint.body == body))
    return found if body in shaped else []


def _leg_name(joint: str, number: int) -> str:
    """`front_left` and the like, where a joint's name says so."""
    corner = re.match(r"(FL|FR|RL|RR|HL|HR|LF|RF|LH|RH|lf|rf|lh|rh|fl|fr|hl|hr|rl|rr)[_A-Z]", joint)
    if corner:
        return corner[1]
    side = next((side for side, pattern in SIDES.items() if pattern.search(joint)), None)
    return side or f"leg_{number}"


def _foot(model: ImportedModel, tip: int) -> str:
    """The last link that is fixed to the tip and named like a foot, else the tip."""
    fixed = [link for link, body in model.links.items() if body == tip and re.search("foot|sole|toe", link, re.I)]
    return fixed[-1] if fixed else model.bodies[tip].name


def _category(legs: list[Leg], wheels: list[str], arm: list[str], eef: list[str]) -> str:
    if len(legs) >= 4:
        return "quadruped"
    if len(legs) >= 2:
        return "humanoid"
    if wheels:
        return "mobile_manipulator" if arm or eef else "base"
    if not arm and eef:
        return "hand"
    two = all(sum(bool(pattern.search(name)) for name in arm) >= 4 for pattern in SIDES.values())
    return "dual_arm" if two else "arm"


def _tool(model: ImportedModel, arm: list[str], eef: list[str]) -> str | None:
    """What is named `tool`, or like one; else the link that carries the fingers; else the last link of the arm."""
    if "tool" in model.frames:
        return "tool"
    named = [link for link in model.links if TOOL.search(link)]
    if named:
        return max(named, key=lambda link: (bool(re.search("tcp|tool|grasp|effector", link, re.I)), model.links[link]))
    number = {joint.name: joint for joint in model.joints}
    if eef:
        return model.bodies[model.bodies[number[eef[0]].body].parent].name
    return model.bodies[number[arm[-1]].body].name if arm else None
