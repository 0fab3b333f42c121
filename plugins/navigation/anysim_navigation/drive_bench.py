"""Bases that drive through furnished rooms in an engine: what `anysim bench navigate` prints."""

from time import process_time
from typing import Any, NamedTuple

import numpy as np

from anysim.api import make
from anysim.conventions import Array
from anysim.skills.base import OUTCOMES, Outcome
from anysim.skills.runner import SkillPolicy
from anysim.task.contract import Status
from anysim.task.env import TaskEnv
from anysim_navigation.agent import Agent, NoRoute
from anysim_navigation.bench import ROOM_STYLES, free_pairs, random_room
from anysim_navigation.maps import NavMaps
from anysim_navigation.navmesh import length_of

DRIVES: dict[str, Any] = {
    "differential_base": "differential_drive",
    "holonomic_base": "holonomic_drive",
    "ackermann_base": {"controller": "ackermann_drive", "params": {"steer_by": "rate"}},
}
"""Bases of the catalogue and their controllers."""
FURTHER = 4.0
"""[m] that ways are longer than."""
HARD = 20.0
"""[N] a contact with something in the room that is harder is a failure."""
LATE = 90.0
"""[s]"""


class Drive(NamedTuple):
    """One way through one room.

    Attributes:
        seed: of the room.
        ended: `success`, or what the episode ended with.
        seconds: that it took, of simulated time.
        length: [m] of the way that was planned first.
        hardest: [N] the hardest contact with something in the room.
        tick: [ms] of processor time that choosing actions took, per control step.
    """

    seed: int
    ended: str
    seconds: float
    length: float
    hardest: float
    tick: float


def drive(seed: int, robot: str, engine: str, *, radius: float = 0.45, planner: str = "dynamic_window") -> Drive | None:
    """Drive a base through the room of a seed; None where no way there is long enough."""
    world = random_room(seed)
    half = np.abs(np.concatenate([world.geoms[g].position for g in world.body_geoms[0]])).max()
    box = [[-half, -half], [half, -half], [half, half], [-half, half]]
    found = _ends(NavMaps(world, Agent(radius), area=box), np.random.default_rng(seed), room_of(seed)["size"])
    if found is None:
        return None
    start, goal, length = found
    rng = np.random.default_rng([seed, 1])
    yaws = rng.uniform(-np.pi, np.pi, 2)
    with make(_task(seed, robot, start, goal, yaws, planner), engine=engine, num_envs=1) as env:
        return _driven(env, seed, length)


def room_of(seed: int) -> dict[str, Any]:
    """The room that `random_room` makes of a seed, as a spec, with a door in each."""
    rng = np.random.default_rng(seed)
    size = [round(float(v), 2) for v in rng.uniform((4.0, 3.8), (7.0, 6.0))]
    sides = rng.permutation(["south", "east", "north", "west"]).tolist()
    count = (1 + seed % 2) if seed % 4 != 3 else 0
    doors = [{"wall": side, "at": round(float(rng.uniform(0.25, 0.75)), 2)} for side in sides[:count]]
    return {"style": ROOM_STYLES[seed % 4], "size": size, "doors": doors, "seed": seed}


def _ends(maps: NavMaps, rng: np.random.Generator, size: list[float]) -> tuple[Array, Array, float] | None:
    mesh = maps.at()
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


def _task(seed: int, robot: str, start: Array, goal: Array, yaws: Array, planner: str) -> dict[str, Any]:
    room = room_of(seed)
    names = ["room", *(e.name for e in random_room(seed).entities if e.name != "room")]
    x, y = (round(float(v), 3) for v in start)
    place = [round(float(v), 3) for v in goal]
    car = robot == "ackermann_base"
    facing: dict[str, Any] = {} if car else {"facing": {"term": "aligned", "a": "base", "b": "goal", "tolerance": 0.1}}
    skill = {"skill": "navigate", "robot": "base", "goal": "goal", "planner": planner, "steps": int(LATE / 0.02)}
    if car:
        skill |= {"heading": False, "tolerance": 0.1, "angle": 3.2}
    return {
        "physics": {"dt": 0.002, "control_dt": 0.02},
        "world": {
            "name": f"drive_{seed}",
            "room": room,
            "robots": {
                "base": {
                    "robot": robot,
                    "position": [x, y, 0.0],
                    "yaw": float(yaws[0]),
                    "actions": {"base": DRIVES.get(robot, "default")},
                }
            },
            "contact_sensors": {f"hit_{name}": {"body": name, "against": "base"} for name in names},
        },
        "task": {
            "description": "Drive to the goal in the room and stand as it points.",
            "horizon": int(LATE / 0.02),
            "command": {"goal": {"term": "goal_pose", "position": [*place, 0.08], "yaw": float(yaws[1])}},
            "observations": {"policy": [{"term": "relative_pose", "a": "base", "b": "goal"}]},
            "success": {
                "there": {"term": "near", "a": "base", "b": "goal", "tolerance": 0.25 if car else 0.1, "axes": "xy"},
                "still": {"term": "still", "frame": "base", "speed": 0.05, "rate": 0.1},
                **facing,
            },
            "failure": {
                f"hit_{name}": {"term": "force_over", "sensor": f"hit_{name}", "limit": HARD} for name in names
            },
            "expert": skill,
        },
        "record": {"cameras": []},
    }


def _driven(env: TaskEnv, seed: int, length: float) -> Drive:
    env.reset(seed=seed)
    policy, one = SkillPolicy(env), np.array([0])
    policy.begin(one)
    hardest, steps, thought = 0.0, 0, 0.0
    while True:
        begun = process_time()
        action = policy.act(one)
        thought += process_time() - begun
        result = env.step(action)
        steps += 1
        forces = env.engine.get_state().contact_force
        hardest = max(hardest, float(np.linalg.norm(forces[0], axis=-1).max(initial=0.0)))
        status = str(result.status[0])
        ended = OUTCOMES[policy.skill.outcome[0]]
        if status == Status.RUNNING and ended not in (Outcome.RUNNING, Outcome.OK):
            status = ended.value
        if status != Status.RUNNING:
            break
    return Drive(seed, status, steps * 0.02, length, hardest, 1e3 * thought / steps)
