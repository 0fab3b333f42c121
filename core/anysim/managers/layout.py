"""LayoutManager: a pose for every object that is there, from the layout of the spec or from a proposal."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import TaskError
from anysim.geometry.convex_parts import Solid, pose_of, row_of
from anysim.managers.base import WORLD, Manager, Overridable, drawn
from anysim.managers.layout_proposals import ProposalSource, Proposed
from anysim.math import pose as P
from anysim.model.slots import is_robot
from anysim.model.world import BodyKind, Slot, World
from anysim.placement.candidate import Candidate
from anysim.placement.clearance import ClearanceQuery
from anysim.placement.constraints import PlacementTask
from anysim.placement.context import PlacementContext, SettledObject
from anysim.placement.nominal import nominal_place, roots_at
from anysim.placement.order import entry_of, placement_order
from anysim.placement.sampler import EpisodeSampler, NominalSampler, PlacementSampler
from anysim.placement.search import NoPlace, RefusedProposal, Search, is_constant
from anysim_schemas.layout import PlaceFields, RepairSpec

IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class LayoutManager(Manager):
    """Finds places in the order in which they need each other (a table before what stands on it) and writes them."""

    name = "layout"

    def __init__(self, proposals: Proposed | None = None) -> None:
        """`proposals` are poses from outside, as in `anysim.make`; they win over the spec's."""
        self._proposals = proposals

    def recall(self, env: int, drawn: Mapping[str, Any]) -> None:
        if self._source is not None:
            self._source.recall(env, drawn)

    def build(self, world: World) -> None:
        self._world = world
        source = self.spec.world.layout_source
        given = self._proposals if self._proposals is not None or source is None else source.proposal
        self._source = None if given is None else ProposalSource(given, source)
        content = self.spec.world
        self._context = PlacementContext(world, content.regions)
        self._clearance = ClearanceQuery(world)
        items = {item.name: item for item in self._context.items}
        order, _ = placement_order(content.layout, self._context.items)
        self._listed = [items[name] for name in order]
        self._others = [item for item in self._context.items if item.name not in order]
        self._entries = {name: entry_of(content.layout, items[name]) or "" for name in order}
        self._still = {
            entity: SettledObject(
                self._context.initial(self._world.entities[entity].name),
                self._solid(entity).fixed,
                True,
                self._solid(entity).collides,
                False,
            )
            for item in self._others
            for entity in item.entities
        }
        self._columns()

    def _solid(self, entity: int) -> Solid:
        return self._context.solid(self._world.entities[entity].name)

    def _columns(self) -> None:
        """The bodies whose poses are written, free ones before fixed ones, and the column of each entity's first."""
        roots: list[tuple[bool, int, int, Array]] = []
        for item in (*self._listed, *(i for i in self._others if not is_robot(self._world, i))):
            for entity in item.entities:
                first = self._world.bodies[self._world.entities[entity].root]
                fixed = first.kind is BodyKind.STATIC
                for body, (position, quaternion) in roots_at(self._world, entity, IDENTITY, IDENTITY[:3], IDENTITY[3:]):
                    roots.append((fixed, entity, body, P.pose(position, quaternion)))
        roots.sort(key=lambda root: root[0])
        self._bodies = np.array([body for _, _, body, _ in roots], dtype=int)
        self._owner = np.array([entity for _, entity, _, _ in roots], dtype=int)
        self._offset = np.array([offset for *_, offset in roots]).reshape(-1, 7)
        self._free = sum(not fixed for fixed, *_ in roots)

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        self._initial = np.array([[*b.position, *b.quaternion] for b in self._world.bodies]).reshape(-1, 7)

    def reset(self, env_ids: Array) -> None:
        if not len(self._bodies):
            return
        presence = self.engine.presence
        poses = np.stack([self._rows(int(env), presence[env]) for env in env_ids])
        free, fixed = self._bodies[: self._free], self._bodies[self._free :]
        if len(free):
            still = np.zeros((len(env_ids), len(free), 6))
            self.engine.set_body_state(poses[:, : self._free], still, env_ids, free)
        if len(fixed):
            self.engine.set_body_state(poses[:, self._free :], None, env_ids, fixed)

    def overridable(self) -> list[Overridable]:
        entries: list[Overridable] = []
        for name, entry in self.spec.world.layout.items():
            if not entry.any_of:
                place = ("position",) if entry.position is not None else ("x", "y")
                given = [key for key in place if getattr(entry, key) is not None]
                entries += drawn(f"{WORLD}layout.{name}", entry, (*given, "roll", "pitch", "yaw"))
        return entries

    def _rows(self, env: int, presence: Array) -> Array:
        """The poses (K, 7) of the bodies that are written, in one env."""
        origin = self.episodes.origin[env]
        there = {item.name: next((e for e in item.entities if presence[e]), None) for item in self._context.items}
        try:
            found = self._plan(env, there)
        except NoPlace as error:
            raise TaskError(f"env {env}: {error}") from None
        rows: dict[int, Array] = {}
        for name, candidate in found.items():
            entity = there[name]
            assert entity is not None
            rows[entity] = row_of(candidate.pose, candidate.quaternion)
        for item in self._others:  # where they are initially, from the origin of the env
            for entity in item.entities:
                rows[entity] = self._initial[self._world.entities[entity].root] + [*origin, 0.0, 0.0, 0.0, 0.0]
        whole = np.array([rows.get(int(entity), IDENTITY) for entity in self._owner])
        lone = (self._offset == IDENTITY).all(axis=1)
        if lone.all():
            return whole
        return np.where(lone[:, None], whole, P.compose(whole, self._offset))

    def _plan(self, env: int, there: Mapping[str, int | None]) -> dict[str, Candidate]:
        """A place for each listed item that is there."""
        x, y, z = (float(v) for v in self.episodes.origin[env])
        origin = (x, y, z)
        tasks: list[PlacementTask] = []
        middles: dict[str, NominalSampler] = {}
        for item in self._listed:
            entity = there[item.name]
            if entity is not None:
                tasks.append(self._task(env, item, self._solid(entity), middles))
        settled: dict[str, SettledObject] = {}
        for item in self._others:
            entity = there[item.name]
            if entity is not None:
                settled[item.name] = self._shifted(env, entity, origin)

        def sampler(task: PlacementTask, tick: int) -> PlacementSampler:
            return middles.get(task.item.name) or self._sampler(env, task, tick)

        def search() -> Search:
            context = self._context.in_env(origin, lambda item: there[item.name] is not None, settled)
            bounds = RepairSpec() if self._source is None else self._source.bounds
            return Search(context, self._clearance, sampler, bounds)

        if self._source is None:
            return search().solve(tasks)
        try:
            self._source.propose(env, self.streams, self._context, tasks, settled)
            return search().solve(tasks)
        except RefusedProposal as error:
            if not self._source.falls_back:
                raise NoPlace(f"the proposal is refused: {error}; see {self._source.path}") from None
            self._source.dismiss(env, self.streams, str(error), tasks)
            return search().solve(tasks)

    def _shifted(self, env: int, entity: int, origin: Sequence[float]) -> SettledObject:
        """What has no entry: where it is initially, from the origin of the env; a robot where it has just been put."""
        still, put = self._still[entity], self.episodes.bases.get(self._world.entities[entity].name)
        if put is not None:
            return still._replace(placed=self._solid(entity).at(pose_of(put[env])))
        if not any(origin):
            return still
        pose = still.placed.pose
        x, y, z = (a + b for a, b in zip(pose.position, origin, strict=True))
        return still._replace(placed=self._solid(entity).at(pose._replace(position=(x, y, z))))

    # ------------------------------------------------------------------ what an entry says in this episode

    def _task(self, env: int, item: Slot, solid: Solid, middles: dict[str, NominalSampler]) -> PlacementTask:
        """The place that an item's entry says in this episode: gated, and one of its alternatives."""
        name = self._entries[item.name]
        entry, path = self.spec.world.layout[name], f"world.layout.{name}"
        if entry.ratio < 1.0:
            sampler = EpisodeSampler(self.streams, env, item.name, path, 0)
            holds = sampler.uniform("ratio", 1)[0] < entry.ratio
            sampler.keep()
            if not holds and entry.otherwise is None:
                middles[item.name] = NominalSampler(item.instance)
                return PlacementTask(item, solid, nominal_place(entry), path, True)
            if not holds:
                assert entry.otherwise is not None
                return PlacementTask(item, solid, entry.otherwise, f"{path}.otherwise", is_constant(entry.otherwise))
        if not entry.any_of:
            return PlacementTask(item, solid, entry, path, is_constant(entry))
        sampler = EpisodeSampler(self.streams, env, item.name, path, 0)
        number = sampler.pick("any_of", [one.weight for one in entry.any_of])
        sampler.keep()
        place = entry.chosen(number)
        return PlacementTask(item, solid, place, f"{path}.any_of.{number}", is_constant(place))

    def _sampler(self, env: int, task: PlacementTask, tick: int) -> EpisodeSampler:
        return EpisodeSampler(self.streams, env, task.item.name, task.path, tick, self._inherited(task))

    def _inherited(self, task: PlacementTask) -> Mapping[str, str]:
        """The fields that an alternative has from its entry, with their paths."""
        base, _, number = task.path.partition(".any_of.")
        if not number:
            return {}
        entry = self.spec.world.layout[self._entries[task.item.name]]
        own = entry.any_of[int(number)].said()
        return {field: f"{base}.{field}" for field in PlaceFields.model_fields if field not in own}
