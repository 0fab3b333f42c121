"""Bases that drive through furnished rooms in an engine: what `anysim bench navigate` prints."""

from time import process_time
from typing import Any, NamedTuple

import numpy as np

from anysim.api import make
from anysim.conventions import Array
from anysim.model.world import World
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.contract import Status
from anysim.task.env import TaskEnv
from anysim_navigation.agent import Agent, NoRoute
from anysim_navigation.maps import NavMaps
from anysim_navigation.navmesh import NavMesh, length_of
from anysim_navigation_bench.rooms import free_pairs, random_room, room_of

FURTHER = 4.0
"""[m] that ways are longer than."""
HARD = 20.0
"""[N] a contact with something in the room that is harder is a failure."""
HIT = {"term": "force_over", "limit": HARD, "steps": 1}
LATE, LATE_AMONG = 90.0, 180.0
"""[s] that a drive may take, and one among people, who may stay in the way."""
CONTROL_DT = 0.02
MOVES = 0.05
"""[m/s] what is slower stands."""
MET = ("", "standing", "moving", "towards")
"""Contacts with people: none, while the base stood, while it moved, and while it moved towards them."""
PEOPLE_APART = 1.2
"""[m] that people begin from where the base does, at least."""
PACES = (0.2, 0.5)
"""[m/s] at which they walk."""
POINTS = 30
"""Of the walk of each of them at most; then it begins anew."""


class Driving(NamedTuple):
    """How a base is driven, and what of it counts as there.

    Attributes:
        radius: [m] of a disc for which there is to be a way: that of the base, and room to turn.
        controller: of its channel `base`.
        skill: parameters of `navigate`.
        close, facing: [m], and 1 less the cosine of the angle; None where the heading is free.
        still: [m/s], [rad/s] that it may have in the end.
        tilts: whether it can fall.
        robot: of the catalogue, where the base is not called as it is.
        dynamics, physics: of that robot and of the world, where they are not the usual ones.
    """

    radius: float = 0.45
    controller: Any = "default"
    skill: dict[str, Any] = {}  # noqa: RUF012 - of a named tuple, and read only
    close: float = 0.1
    facing: float | None = 0.1
    still: tuple[float, float] = (0.05, 0.1)
    tilts: bool = False
    robot: str | None = None
    dynamics: dict[str, Any] = {}  # noqa: RUF012
    physics: dict[str, Any] = {}  # noqa: RUF012


_WALK = "package:anysim_tasks/legged/go1_velocity/walk.yaml"
_AS_GO1 = {"tolerance": 0.15, "angle": 0.15, "speed": 0.5, "rate": 0.8}
_ON_LEGS: dict[str, Any] = {"close": 0.25, "facing": 0.3, "still": (0.15, 0.6), "tilts": True}
BASES: dict[str, Driving] = {
    "differential_base": Driving(controller="differential_drive", skill={"rate": 2.5}),
    "holonomic_base": Driving(controller="holonomic_drive", skill={"rate": 2.5}),
    "ackermann_base": Driving(
        0.7,
        {"controller": "ackermann_drive", "params": {"steer_by": "rate"}},
        {"heading": False, "tolerance": 0.1, "angle": 3.2},
        close=0.25,
        facing=None,
    ),
    "unitree_go1": Driving(skill=_AS_GO1, **_ON_LEGS),
    "unitree_go1_learned": Driving(
        robot="unitree_go1",
        controller={"controller": "policy", "params": {"options": {"file": _WALK}}},
        dynamics={"kp_scale": 0.26667, "kd_scale": 0.33333},  # and physics as it was trained with
        physics={"dt": 0.004, "actuation": "explicit_pd"},
        skill=_AS_GO1,
        **_ON_LEGS,
    ),
    "unitree_g1": Driving(
        controller="lipm_walk", skill={"tolerance": 0.15, "angle": 0.15, "speed": 0.25, "rate": 0.3}, **_ON_LEGS
    ),
}
"""Bases of the catalogue; others are driven by their default controller, and as a base on wheels is."""


class Drive(NamedTuple):
    """One way through one room.

    Attributes:
        seed: of the room.
        ended: `success`, the outcome of the skill, `truncated`, or what failed: `contact`, `person`, `fell`.
        seconds: that it took, of simulated time.
        length: [m] of the way that was planned first.
        hardest: [N] the hardest contact with something in the room.
        tick: [ms] of processor time that choosing actions took, per control step.
        met: the worst contact with people, of `MET`.
    """

    seed: int
    ended: str
    seconds: float
    length: float
    hardest: float
    tick: float
    met: str = ""


def drive(
    seed: int,
    robot: str,
    engine: str,
    *,
    radius: float | None = None,
    people: int = 0,
    pace: float = 1.0,
    planner: str = "dynamic_window",
) -> Drive | None:
    """Drive a base through the room of a seed; None where no way there is long enough.

    `people` walk between points of the room meanwhile, at `pace` times `PACES`, and yield to nothing.
    """
    world, how = random_room(seed), BASES.get(robot, Driving())
    half = np.abs(np.concatenate([world.geoms[g].position for g in world.body_geoms[0]])).max()
    box = [[-half, -half], [half, -half], [half, half], [-half, half]]
    mesh = NavMaps(world, Agent(how.radius if radius is None else radius), area=box).at()
    found = _ends(mesh, np.random.default_rng(seed), room_of(seed)["size"])
    if found is None:
        return None
    start, goal, length = found
    yaws = np.random.default_rng([seed, 1]).uniform(-np.pi, np.pi, 2)
    steps = int((LATE_AMONG if people else LATE) / CONTROL_DT)
    task = _task(seed, world, robot, how, start, goal, yaws, planner, steps)
    if people:
        walks = NavMaps(world, Agent(0.3, 1.9), area=box).at()
        task["world"]["families"] = {"person": _people(people, pace, walks, start, np.random.default_rng([seed, 2]))}
        for name in ["person"] if people == 1 else [f"person_{number}" for number in range(people)]:
            task["world"]["contact_sensors"][f"met_{name}"] = {"body": name, "against": "base"}
            task["task"]["failure"][f"met_{name}"] = {**HIT, "sensor": f"met_{name}"}
    with make(task, engine=engine, num_envs=1) as env:
        return _driven(env, seed, length)


def _ends(mesh: NavMesh, rng: np.random.Generator, size: list[float]) -> tuple[Array, Array, float] | None:
    half = 0.5 * np.array(size)
    for start, goal in free_pairs(mesh, 400, rng):
        if (np.abs(start) > half).any() or (np.abs(goal) > half).any():
            continue
        try:
            length = length_of(mesh.path(start, goal))
        except NoRoute:
            continue
        if length > FURTHER:
            return start, goal, length
    return None


def _people(count: int, pace: float, mesh: NavMesh, start: Array, rng: np.random.Generator) -> dict[str, Any]:
    """Avatars that walk around furniture between random points, and begin away from the base."""
    each: list[dict[str, Any]] = []
    pairs = iter(free_pairs(mesh, 40 * count, rng).reshape(-1, 2))
    while len(each) < count:
        begin = here = next(pairs)
        if np.hypot(*(begin - start)) < PEOPLE_APART:
            continue
        points: list[Array] = []
        for target in (*(next(pairs) for _ in range(4)), begin):
            try:
                stretch = mesh.path(here, target)[1:]
            except NoRoute:  # of two parts of the room
                continue
            if len(points) + len(stretch) <= POINTS:
                points, here = [*points, *stretch], target
        walk = [[round(float(v), 3) for v in point] for point in points]
        speed = round(pace * float(rng.uniform(*PACES)), 3)
        do = [{"path": walk[k : k + 16], "speed": speed} for k in range(0, len(walk), 16)]
        each.append({"x": round(float(begin[0]), 3), "y": round(float(begin[1]), 3), "do": do})
    return {"kind": "avatar", "seed": int(rng.integers(1000)), "each": each, "again": True}


def _task(
    seed: int, world: World, robot: str, how: Driving, start: Array, goal: Array, yaws: Array, planner: str, steps: int
) -> dict[str, Any]:
    names = ["room", *(e.name for e in world.entities if e.name != "room")]
    x, y = (round(float(v), 3) for v in start)
    place = [round(float(v), 3) for v in goal]
    facing: dict[str, Any] = {}
    if how.facing is not None:
        facing = {"facing": {"term": "aligned", "a": "base", "b": "goal", "tolerance": how.facing}}
    upright = {"upright": {"frame": "base", "tolerance": 0.6}}
    fell = {"fell": {"term": "not", "of": upright}} if how.tilts else {}
    skill = {"skill": "navigate", "robot": "base", "goal": "goal", "planner": planner, "steps": steps}
    return {
        "physics": {"dt": 0.002, "control_dt": CONTROL_DT, **how.physics},
        "world": {
            "name": f"drive_{seed}",
            "room": room_of(seed),
            "robots": {
                "base": {
                    "robot": how.robot or robot,
                    "position": [x, y, 0.0],
                    "yaw": float(yaws[0]),
                    "dynamics": how.dynamics,
                    "actions": {"base": how.controller},
                }
            },
            "contact_sensors": {f"hit_{name}": {"body": name, "against": "base"} for name in names},
        },
        "task": {
            "description": "Drive to the goal in the room and stand as it points.",
            "horizon": steps,
            "command": {"goal": {"term": "goal_pose", "position": [*place, 0.08], "yaw": float(yaws[1])}},
            "observations": {"policy": [{"term": "relative_pose", "a": "base", "b": "goal"}]},
            "success": {
                "there": {"term": "near", "a": "base", "b": "goal", "tolerance": how.close, "axes": "xy"},
                "still": {"term": "still", "frame": "base", "speed": how.still[0], "rate": how.still[1]},
                **facing,
            },
            "failure": {f"hit_{name}": {**HIT, "sensor": f"hit_{name}"} for name in names} | fell,
            "expert": skill | how.skill,
        },
        "record": {"cameras": []},
    }


def _driven(env: TaskEnv, seed: int, length: float) -> Drive:
    env.reset(seed=seed)
    policy, one = SkillPolicy(env), np.array([0])
    policy.begin(one)
    world, base = env.engine.world, env.scene.robot("base").base
    names = [sensor.name for sensor in world.contact_sensors]
    things = np.array([name.startswith("hit_") for name in names])
    people = np.array([world.entities[world.entity_numbers[n[4:]]].root for n in np.array(names)[~things]], dtype=int)
    hardest, steps, thought, met = 0.0, 0, 0.0, 0
    while True:
        begun = process_time()
        action = policy.act(one)
        thought += process_time() - begun
        env.scene.look(None)
        speed = base.twist[0, :2].copy()
        towards = env.engine.get_state().body_pose[0, people, :2] - base.position[0, :2]
        result = env.step(action)
        steps += 1
        force = np.linalg.norm(env.engine.get_state().contact_force[0], axis=-1)
        hardest = max(hardest, float(force[things].max(initial=0.0)))
        for way in towards[force[~things] > 0.0]:
            moves = np.hypot(*speed) > MOVES
            met = max(met, 1 + int(moves) + int(moves and speed @ way > MOVES * np.hypot(*way)))
        status = str(result.status[0])
        ended = OUTCOMES[policy.skill.outcome[0]]
        if status == Status.RUNNING and ended not in (Outcome.RUNNING, Outcome.OK):
            status = ended.value
        if status != Status.RUNNING:
            break
    if status == Status.FAILED:
        over = force > HARD
        status = "contact" if over[things].any() else "person" if over.any() else "fell"
    return Drive(seed, status, steps * CONTROL_DT, length, hardest, 1e3 * thought / steps, MET[met])
