"""Events found a second time: in raw arrays of a recording, and in its annotations read from the end."""

import numpy as np

from anysim_language.check.scene import RawScene
from anysim_language.episode import Episode


def first_step(episode: Episode, kind: str, what: str) -> int | None:
    """The control step at which something first happens; None where it does not."""
    world = episode.world
    if kind == "lifted":
        number = next(thing.entity for thing in episode.things if thing.name == what)
        root = world.entities[number].body_start
        start = RawScene(world, episode.body_pose[0]).bounds(number)[0][2]
        candidates = np.flatnonzero(episode.body_pose[:, root, 2] > episode.body_pose[0, root, 2] + 0.005)
        return next(
            (
                k
                for k in candidates.tolist()
                if RawScene(world, episode.body_pose[k]).bounds(number)[0][2] > start + 0.015
            ),
            None,
        )
    joint = next(j for j, one in enumerate(world.joints) if world.bodies[one.body].name == what)
    limits = world.joints[joint]
    share = (episode.joint_pos[:, joint] - limits.lower) / (limits.upper - limits.lower)
    if kind != "closed":
        steps = np.flatnonzero((share[1:] >= 0.5) & (share[:-1] < 0.5)) + 1
    else:
        steps = np.flatnonzero((share <= 0.05) & (np.maximum.accumulate(share) > 0.2))
    return int(steps[0]) if len(steps) else None


def next_doing(episode: Episode, step: int) -> tuple[int, str, str] | None:
    """(step, kind, what) of the first change of skill or narrated phase after a step, from the annotations alone.

    Read from the end to the beginning: what changes at a step is what its annotation has and the one before has not.
    """
    assert episode.reader is not None
    rows = [_words(dict(row)) for row in episode.reader.annotations]
    known = episode.vocabulary.words
    found: tuple[int, str, str] | None = None
    for k in range(len(rows) - 1, step - 1, -1):
        skill, phase = rows[k]
        before = rows[k - 1] if k else ("", "")
        name = skill.split(" ")[1]
        if skill != before[0] and name in known.skills and any(deed.skill == name for deed in episode.deeds):
            found = (k + 1, "began", skill)
        elif (skill, phase) != before and phase in known.phases and _tellable(episode, name, known.phases[phase]):
            found = (k + 1, "phase", phase)
    return found


def _words(row: dict[str, object]) -> tuple[str, str]:
    """The numbered skill and the phase of an annotation."""
    phase, skill = str(row.get("phase", "")), f"0 {row.get('skill', '')}"
    parts = phase.split(": ")
    head = parts[0].split(" ")
    if len(head) == 2 and head[0].isdigit():
        skill = parts[0]
    return skill, parts[-1]


def _tellable(episode: Episode, skill: str, template: str) -> bool:
    """Whether a phase's words need no object, or one of the skill's has one."""
    if "what" not in template:
        return True
    names = {thing.name for thing in episode.things}
    return any(
        str(deed.params.get(key, "")).split(".")[0] in names
        for deed in episode.deeds
        if deed.skill == skill
        for key in ("object", "part", "button", "vessel")
    )
