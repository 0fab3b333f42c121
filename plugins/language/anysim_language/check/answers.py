"""Answers found a second time: from raw poses, triangles and annotations, by code of its own."""

from collections.abc import Callable, Mapping
from math import atan2, degrees, pi
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from anysim.conventions import Array
from anysim_language.check.forks import ForkedAgain
from anysim_language.check.reach import reaches
from anysim_language.check.resolve import resolve
from anysim_language.check.scene import RawScene, colour_of
from anysim_language.check.sight import seen_share
from anysim_language.check.times import first_step, next_doing
from anysim_language.episode import Episode
from anysim_language.questions.question import Question
from anysim_language.things import Thing

NUMBERS = "no one two three four five six seven eight nine ten eleven twelve".split()
MADE_OF = {"wooden": "wood"}
DOWN = np.array([0.0, 0.0, -1.0])


class Checker:
    """Verifies questions about one episode. What it needs of a moment is made once."""

    def __init__(self, episode: Episode) -> None:
        self.episode = episode
        self._scenes: dict[int, RawScene] = {}
        self._forks: ForkedAgain | None = None
        self._under: dict[tuple[int, str], tuple[str, str] | None] = {}
        viewer = next((thing for thing in episode.things if thing.robot), None)
        self.origin, self.forward = np.zeros(3), np.array([1.0, 0.0, 0.0])
        if viewer is not None:
            pose = episode.body_pose[0, episode.world.entities[viewer.entity].body_start]
            ahead = Rotation.from_quat(np.array(pose[3:])).apply([1.0, 0.0, 0.0]) * [1.0, 1.0, 0.0]
            self.origin, self.forward = np.array(pose[:3]), ahead / np.linalg.norm(ahead)
        self.left = np.array([-self.forward[1], self.forward[0], 0.0])

    def verify(self, question: Question) -> bool:
        """Whether the question's references fit their things alone, and its answer is what is found a second time."""
        scene = self.scene(question.step)
        for phrase, name in question.refers.items():
            if resolve(phrase, self.episode.things, scene, self.origin, self.forward) != [name]:
                return False
        return _FAMILIES[question.family](self, question, question.program)

    @property
    def forks(self) -> ForkedAgain:
        """The engine of the recording, begun anew; made where it is first needed."""
        self._forks = self._forks or ForkedAgain(self.episode)
        return self._forks

    def close(self) -> None:
        """Free the engine."""
        if self._forks is not None:
            self._forks.close()
            self._forks = None

    def scene(self, step: int) -> RawScene:
        """The raw numbers of a control step."""
        if step not in self._scenes:
            scene = RawScene(self.episode.world, self.episode.body_pose[step])
            for before in self._scenes.values():
                scene.take_over(before)
            self._scenes = {step: scene}
        return self._scenes[step]

    def thing(self, name: str) -> Thing:
        """By its logical name."""
        return next(thing for thing in self.episode.things if thing.name == name)

    def middle(self, step: int, name: str) -> Array:
        """Of the box around a thing (3,) [m]."""
        return self.scene(step).middle(self.thing(name).entity)

    def objects(self) -> list[Thing]:
        """What is neither a robot nor a room."""
        world = self.episode.world
        return [
            t for t in self.episode.things if not t.robot and not world.entities[t.entity].source.startswith("room")
        ]

    def under(self, step: int, name: str) -> tuple[str, str] | None:
        """(`on` or `in`, what) of a thing: what a ray meets first below it; None in the air."""
        key = (step, name)
        if key not in self._under:
            self._under[key] = self._found_under(step, name)
        return self._under[key]

    def _found_under(self, step: int, name: str) -> tuple[str, str] | None:
        scene, world, thing = self.scene(step), self.episode.world, self.thing(name)
        low, high = scene.bounds(thing.entity)
        start = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, high[2] + 1e-6])
        bottom = start[2] - low[2]
        for other in self.objects():
            if other.name == name:
                continue
            for body in scene.bodies(other.entity):
                points = scene.triangles(body)[0]
                if not len(points):
                    continue
                least, most = points.min(axis=0), points.max(axis=0)
                sites = [s.name for s in world.sites if s.body == body]
                holds = other.words.container or any(s.split(".")[-1] == "inside" for s in sites)
                within = bool(((least[:2] < start[:2]) & (start[:2] < most[:2])).all())
                if holds and within and least[2] - 0.008 <= low[2] < most[2] - 0.008:
                    return "in", self._part(other, body)
        best: tuple[float, str] | None = None
        for other in self.objects():
            if other.name == name:
                continue
            for body in scene.bodies(other.entity):
                for distance in scene.hits(body, start, DOWN).tolist():
                    if abs(distance - bottom) <= 0.0085 and (best is None or distance < best[0]):
                        best = (distance, self._part(other, body))
        if best is not None:
            return "on", best[1]
        return ("on", "ground") if abs(low[2]) <= 0.0085 else None

    def _part(self, thing: Thing, body: int) -> str:
        entity = self.episode.world.entities[thing.entity]
        own = self.episode.world.bodies[body].name[len(entity.name) :] if body != entity.body_start else ""
        return f"{thing.name}{own}"

    def names_beside(self, step: int, relation: str, where: str) -> list[str]:
        """The things on or in the same."""
        return [t.name for t in self.objects() if self.under(step, t.name) == (relation, where)]


def _named(question: Question, name: str) -> bool:
    """Whether the answer is the phrase of a thing."""
    return question.refers.get(question.answer.removeprefix("the ")) == name


def _colour(thing: Thing) -> str:
    names = {colour_of(*paint) for paint in thing.paint}
    return names.pop() if len(names) == 1 else ""


def _count(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    alike = [t for t in checker.objects() if t.words.noun == program["noun"]]
    number = sum(not program["colour"] or _colour(t) == program["colour"] for t in alike)
    return question.answer == (NUMBERS[number] if number < len(NUMBERS) else str(number))


def _exist(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    there = any(t.words.noun == program["noun"] and _colour(t) == program["colour"] for t in checker.objects())
    return question.answer == ("yes" if there else "no")


def _material(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    material = checker.thing(program["thing"]).material
    return question.answer == MADE_OF.get(material, material)


def _support(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    found = checker.under(question.step, program["thing"])
    if found != (program["relation"], program["where"]):
        return False
    owner = program["where"].split(".")[0]
    phrase = "ground" if owner == "ground" else next(p for p, name in question.refers.items() if name == owner)
    return question.answer.endswith(f"the {phrase}")


def _supported(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    found = checker.under(question.step, program["thing"])
    return question.answer == ("yes" if found == (program["relation"], program["where"]) else "no")


def _spatial(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    offset = checker.middle(question.step, program["a"]) - checker.middle(question.step, program["b"])
    bearing = degrees(atan2(float(offset @ checker.left), float(offset @ checker.forward)))
    side = ("behind", "left", "before", "right")[int(((bearing + 405.0) % 360.0) // 90.0)]
    return question.answer == ("yes" if side == program["side"] else "no")


def _nearest(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    thing, step = program["thing"], question.step
    names = [n for n in checker.names_beside(step, program["relation"], program["where"]) if n != thing]
    here = checker.middle(step, thing)
    far = {name: float(np.linalg.norm(checker.middle(step, name) - here)) for name in names}
    return len(far) > 1 and _named(question, min(far, key=lambda name: far[name]))


def _superlative(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    step = question.step
    names = checker.names_beside(step, program["relation"], program["where"])
    measure: dict[str, float] = {}
    for name in names:
        low, high = checker.scene(step).bounds(checker.thing(name).entity)
        middle = (low + high) / 2.0
        measure[name] = {
            "tallest": float(high[2] - low[2]),
            "lowest": float(low[2] - high[2]),
            "left": float(middle @ checker.left),
            "furthest": float(middle @ checker.forward),
        }[program["kind"]]
    return len(names) > 1 and _named(question, max(measure, key=lambda name: measure[name]))


def _visibility(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    share = seen_share(
        checker.episode, checker.scene(question.step), checker.thing(program["thing"]), program["camera"]
    )
    return question.answer == ("yes" if share > 0.15 else "no")


def _reachability(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    robot = next(robot for robot in checker.episode.world.robots if robot.name == program["robot"])
    place = checker.middle(question.step, program["thing"])
    return question.answer == ("yes" if reaches(checker.episode, question.step, robot, place) else "no")


def _order(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    steps = [first_step(checker.episode, *program[key]) for key in "ab"]
    if any(step is None for step in steps):
        return False
    first = min((0, 1), key=lambda k: steps[k] or 0)
    name = program["ab"[first]][1].split(".")[0]
    phrase = next(phrase for phrase, other in question.refers.items() if other == name)
    return "ab"[first] == program["first"] and phrase in question.answer


def _changed(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    first = RawScene(checker.episode.world, checker.episode.body_pose[0])
    moved = [
        t.name
        for t in checker.objects()
        if np.linalg.norm(first.middle(t.entity, True) - checker.scene(question.step).middle(t.entity, True)) > 0.03
    ]
    told = all(any(p in question.answer for p, name in question.refers.items() if name == m) for m in moved)
    return moved == list(program["moved"]) and told and (question.answer == "nothing") == (not moved)


def _opened(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    """By how far the part has turned or slid against its parent, from the poses of both."""
    world = checker.episode.world
    joint = next(j for j in world.joints if j.name == program["joint"])
    body, parent = joint.body, world.bodies[joint.body].parent
    poses = checker.episode.body_pose[: question.step + 1]
    turn = Rotation.from_quat(np.array(poses[:, body, 3:]))
    base = Rotation.from_quat(np.array(poses[:, parent, 3:])) if parent >= 0 else Rotation.identity(len(poses))
    if joint.type == "revolute":
        relative = base.inv() * turn
        travel = (relative[0].inv() * relative).magnitude()
        reached = float(travel.max()) / (joint.upper - joint.lower)
        if joint.upper - joint.lower > pi:
            return True  # an angle between two orientations does not tell turns of more than half a circle
    else:
        origin = poses[:, parent, :3] if parent >= 0 else np.zeros((len(poses), 3))
        local = base.inv().apply(poses[:, body, :3] - origin)
        reached = float(np.linalg.norm(local - local[0], axis=1).max()) / (joint.upper - joint.lower)
    return question.answer == ("yes" if reached > 0.25 else "no")


def _next(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    return next_doing(checker.episode, question.step) == (program["step"], program["kind"], program["what"])


def _counterfactual(checker: Checker, question: Question, program: Mapping[str, Any]) -> bool:
    outcome = checker.forks.outcome(question.step, program)
    return outcome == program["outcome"] and question.answer == checker.episode.vocabulary.words.outcomes[outcome]


_FAMILIES: Mapping[str, Callable[[Checker, Question, Mapping[str, Any]], bool]] = {
    "count": _count,
    "exist": _exist,
    "colour": lambda checker, question, program: question.answer == _colour(checker.thing(program["thing"])),
    "material": _material,
    "support": _support,
    "supported": _supported,
    "spatial": _spatial,
    "nearest": _nearest,
    "superlative": _superlative,
    "visibility": _visibility,
    "reachability": _reachability,
    "order": _order,
    "changed": _changed,
    "opened": _opened,
    "next": _next,
    "counterfactual": _counterfactual,
}
