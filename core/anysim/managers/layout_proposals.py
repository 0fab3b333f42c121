"""Proposals of poses: asked for once an episode, noted in its record, and set aside where they cannot be kept.

A recorded episode is replayed from the poses in its record; neither file nor proposer is needed then.
"""

from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from anysim import registry
from anysim.geometry.convex_parts import IDENTITY, Pose
from anysim.placement.constraints import PlacementTask
from anysim.placement.context import PlacementContext, SettledObject
from anysim.placement.proposals import LevelSurface, Proposer, Request, Thing, faults, parsed, read_file
from anysim.placement.search import RefusedProposal
from anysim.placement.support_surfaces import HEADROOM
from anysim.randomization.streams import Origin, Streams
from anysim_schemas.files import exists
from anysim_schemas.layout import LayoutSourceSpec, RepairSpec
from anysim_schemas.proposals import Proposal

STREAM = "layout/proposal"
"""The name of what was proposed in the record of an episode, and of the stream that chooses among several."""

REFUSED = "layout/proposal_refused"


Proposed = Path | str | Proposal | Mapping[str, Any] | list[Any] | Proposer
"""Proposals as data or JSON text, a JSON file, a callable that gives them, or the name of an installed one."""


class ProposalSource:
    """Takes proposals for all envs."""

    path = "world.layout_source"

    def __init__(self, given: Proposed, spec: LayoutSourceSpec | None) -> None:
        """`given` is not looked at before it is needed, but for a file that is there; `spec` has the bounds."""
        self.bounds = RepairSpec() if spec is None else spec.repair
        self.falls_back = spec is not None and spec.on_refusal == "layout"
        self._given = given
        self._ready: tuple[Proposal, ...] | Proposer | None = None
        self._recalled: dict[int, Any] = {}
        if isinstance(given, Path) and exists(given):
            self._ready = read_file(given, f"{self.path}.proposal")

    def recall(self, env: int, drawn: Mapping[str, Any]) -> None:
        """The next reset of this env takes what a record holds."""
        if STREAM in drawn:
            self._recalled[env] = drawn[STREAM]

    def propose(
        self,
        env: int,
        streams: Streams,
        context: PlacementContext,
        tasks: Sequence[PlacementTask],
        settled: Mapping[str, SettledObject],
    ) -> None:
        """Give the tasks the poses that are proposed for them.

        Raises:
            RefusedProposal: names that do not exist, or numbers that are no pose; a sentence for each.
        """
        if env in self._recalled:
            chosen = parsed(self._recalled.pop(env), "the record", self.path)[0]
        else:
            seed = int(streams.generator(env, STREAM).integers(0, 2**31))
            offers = self._offers(lambda: _request(context, tasks, settled, seed))
            chosen = offers[seed % len(offers)]
        data = chosen.model_dump(mode="json", exclude_defaults=True)
        streams.note(env, STREAM, data, Origin(STREAM, self.path))
        wrong = faults(chosen, [task.item.name for task in tasks])
        if wrong:
            raise RefusedProposal("; ".join(wrong.values()))
        for task in tasks:
            task.proposed = chosen.poses.get(task.item.name)

    def dismiss(self, env: int, streams: Streams, why: str, tasks: Sequence[PlacementTask]) -> None:
        """Go on without what was proposed, and say so in the record."""
        streams.note(env, REFUSED, why, Origin(STREAM, self.path))
        for task in tasks:
            task.proposed = None
            task.tick = 0

    def _offers(self, request: Any) -> tuple[Proposal, ...]:
        if self._ready is None:
            self._ready = self._found()
        if isinstance(self._ready, tuple):
            return self._ready
        asked = request()
        with registry.Blame(f"{self.path}: the proposer '{_name(self._ready)}'", registry.origin(self._ready)):
            offered = self._ready(asked)
        return parsed(offered, f"what '{_name(self._ready)}' gives", self.path)

    def _found(self) -> tuple[Proposal, ...] | Proposer:
        given = self._given
        if isinstance(given, str) and given.lstrip()[:1] not in ("{", "["):
            given = Path(given) if given.endswith(".json") else registry.load("layouts", given)
        if callable(given):
            return given
        if isinstance(given, Path):
            return read_file(given, f"{self.path}.proposal")
        return parsed(given, "what was given to make()", self.path)


def _name(proposer: Proposer) -> str:
    return getattr(proposer, "__qualname__", type(proposer).__name__)


def _request(
    context: PlacementContext, tasks: Sequence[PlacementTask], settled: Mapping[str, SettledObject], seed: int
) -> Request:
    """What a proposer is told: sizes, nominal supports and what the layout says. Plain data."""
    world = context.world
    things, supports = [], []
    for task in tasks:
        box = task.solid.at(Pose((0.0, 0.0, 0.0), IDENTITY))
        x, y, z = (round(h - w, 9) for w, h in zip(box.low, box.high, strict=True))
        entity = next(e for e in world.entities if e.name == task.solid.name)
        things.append(
            Thing(
                task.item.name,
                task.item.category,
                entity.label,
                (x, y, z),
                round(-box.low[2], 9),
                task.place.model_dump(mode="json", by_alias=True, exclude_defaults=True),
            )
        )
    initial = {task.item.name: context.initial(task.solid.name) for task in tasks}
    initial |= {name: one.placed for name, one in settled.items() if name not in {r.name for r in world.robots}}
    still = [p for name, p in initial.items() if name in settled or context.solid(p.name).fixed]
    for name, placed in initial.items():
        if not context.solid(placed.name).fixed:
            continue
        x, y, z = placed.pose.position
        for surface in context.surfaces_of(placed):
            height = z + surface.height
            taken = [
                (p.low[0], p.low[1], p.high[0], p.high[1])
                for p in still
                if p is not placed and p.low[2] < height + HEADROOM and p.high[2] > height + 1e-6
            ]
            outline = [(x + px, y + py) for px, py in surface.polygon]
            headroom = 1e3 if surface.headroom == inf else surface.headroom
            supports.append(LevelSurface(f"{name}.{surface.name}", height, headroom, outline, taken))
    robots = {
        robot.name: [float(v) for v in np.array(world.bodies[e.root].position)]
        for robot in world.robots
        for e in world.entities
        if e.name == robot.name
    }
    return Request(world.name, seed, things, supports, robots)
