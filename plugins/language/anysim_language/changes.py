"""Change points of a recorded episode, found in its states: what was lifted, held, moved, put down, opened, closed."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import BodyKind
from anysim_language.episode import Episode
from anysim_language.joints import movable_parts
from anysim_language.relations import GROUND, Support, support
from anysim_language.things import Thing

STEADY = 5
"""Control steps for which something holds before it counts."""
WINDOW = 10
"""Control steps over which two things are compared, to be moving together."""
TOGETHER = 0.003
"""By how much [m] the place of a held thing in the tool's frame changes within the window, at most."""
MOVED = 0.010
"""From this distance [m] within the window on a thing is moving."""
REACH = 0.15
"""What is held is at most so far from the tool [m]."""
RISEN = 20
"""What is lifted has risen by so much [mm]."""
OPEN, SHUT, AJAR = 0.5, 0.05, 0.2
"""Shares of a joint's range: open from the first on, closed below the second once it was above the third."""


class Change(NamedTuple):
    """Something that begins to be so at a control step.

    `what` is a thing, a robot or a part; `where` the other one that it is about, `relation` how.
    """

    step: int
    kind: str
    what: str
    where: str = ""
    relation: str = ""


def changes(episode: Episode) -> list[Change]:
    """All changes in the order in which they happen."""
    found: list[Change] = []
    for thing in episode.first.objects:
        if thing.count == 1 and not thing.fixed:
            found += _travels(episode, thing)
            found += _holds(episode, thing)
    found += _joints(episode)
    return sorted(found, key=lambda change: (change.step, _ORDER.index(change.kind), change.what, change.where))


_ORDER = ("grasped", "lifted", "left", "moved", "turned", "pressed", "opened", "closed", "placed", "released")


def _travels(episode: Episode, thing: Thing) -> Iterator[Change]:
    """From support to support, and along the ground."""
    root = episode.world.entities[thing.entity].root
    if episode.world.bodies[root].kind is not BodyKind.FREE:
        return
    place = episode.body_pose[:, root, :3]
    moving = _moving(place)
    resting = support(episode.first, thing)
    low = episode.first.extent(thing.name).low[2]
    lifted = slid = False
    for step in range(1, len(place)):
        if lifted or moving[step]:
            moment = episode.moment(step)
            held = support(moment, thing)
            bottom = moment.extent(thing.name).low[2]
            if not lifted and held is None and bottom >= low + RISEN:
                lifted = True
                kind = "left" if _travelling(episode, resting, step) else "lifted"
                yield Change(step, kind, thing.name, resting.where if resting else "", "")
            elif (
                not lifted
                and not slid
                and held is not None
                and resting is not None
                and held.where == resting.where
                and not _travelling(episode, held, step)
            ):
                slid = True
                yield Change(step, "moved", thing.name, held.where, held.relation)
            elif lifted and held is not None and not moving[max(step - STEADY, 0) : step + 1].any():
                lifted, resting, low = False, held, bottom
                yield Change(step, "placed", thing.name, held.where, held.relation)


def _travelling(episode: Episode, held: Support | None, step: int) -> bool:
    """Whether what carries a thing moves itself: then the thing is carried along, as beads in a cup are."""
    if held is None or held.where == GROUND:
        return False
    root = episode.world.entities[episode.first.by_name[held.where.partition(".")[0]].entity].root
    if episode.world.bodies[root].kind is not BodyKind.FREE:
        return False
    return bool(_moving(episode.body_pose[max(step - WINDOW, 0) : step + 1, root, :3])[-1])


def _moving(place: Array) -> Array:
    """(K,) bool: whether a point (K, 3) has come further than MOVED within the last WINDOW steps."""
    before = place[np.maximum(np.arange(len(place)) - WINDOW, 0)]
    return np.linalg.norm(place - before, axis=1) > MOVED


def _holds(episode: Episode, thing: Thing) -> Iterator[Change]:
    """When a thing moves with the tool of a robot, and when it no longer does."""
    world, poses = episode.world, episode.body_pose
    root = world.entities[thing.entity].root
    place = poses[:, root, :3]
    moving, ago = _moving(place), np.maximum(np.arange(len(place)) - WINDOW, 0)
    for robot in world.robots:
        for number in dict.fromkeys(robot.tools.values()):
            site = world.sites[number]
            if site.body < 0:
                continue
            tool = P.compose(poses[:, site.body], P.pose(site.position, site.quaternion))
            local = P.rotate(P.conjugate(tool[:, 3:]), place - tool[:, :3])
            together = np.linalg.norm(local - local[ago], axis=1) <= TOGETHER
            close = np.linalg.norm(local, axis=1) <= REACH
            carried = moving & together & close & (np.linalg.norm(tool[:, :3] - tool[ago, :3], axis=1) > MOVED)
            held = False
            for step in np.flatnonzero(carried | ~together | ~close).tolist():
                if held == bool(carried[step]):
                    continue
                if carried[step] and not _travelling(episode, support(episode.moment(step), thing), step):
                    held = True
                    yield Change(step, "grasped", thing.name, robot.name)
                elif held:
                    held = False
                    yield Change(step, "released", thing.name, robot.name)


def _joints(episode: Episode) -> Iterator[Change]:
    """What is done to movable parts: doors, drawers, buttons, valves."""
    for thing in episode.first.objects:
        for part in movable_parts(episode.world, thing.entity):
            share = (episode.joint_pos[:, part.joint] - part.lower) / (part.upper - part.lower)
            is_open, was_ajar = bool(share[0] >= OPEN), bool(share[0] >= AJAR)
            for step in range(1, len(share)):
                was_ajar = was_ajar or bool(share[step] >= AJAR)
                if not is_open and share[step] >= OPEN:
                    is_open = True
                    yield Change(step, part.done, part.name)
                elif was_ajar and share[step] <= SHUT:
                    is_open = was_ajar = False
                    if part.done == "opened":
                        yield Change(step, "closed", part.name)
