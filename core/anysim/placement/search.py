"""The search for a place for everything in one env: draw, check, draw again, go back on earlier draws, pack.

Bounded: each thing is drawn at most `ATTEMPTS` times in a row, earlier things are moved out of the way at most
`RETREATS` times, and what still finds no place is packed with its neighbours, once. Nothing depends on time.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from anysim.placement import repair
from anysim.placement.candidate import Candidate, candidate
from anysim.placement.clearance import ClearanceQuery
from anysim.placement.constraints import Constraints, Objection, PlacementTask
from anysim.placement.context import Impossible, PlacementContext, SettledObject
from anysim.placement.order import meant
from anysim.placement.packing import GAP, packed
from anysim.placement.sampler import PlacementSampler
from anysim.placement.standing_areas import free_area, standing_areas_of
from anysim_schemas.layout import PlaceFields, RepairSpec
from anysim_schemas.proposals import ProposedPose
from anysim_schemas.values import Distribution

ATTEMPTS = 100
"""Draws of one object's place in a row."""

RETREATS = 12
"""How often in an env something that has its place gives it up for something else."""


class NoPlace(Exception):
    """Something does not fit; the message is a sentence."""


class RefusedProposal(NoPlace):
    """A proposal cannot be kept; the message has a sentence for each object."""


@dataclass
class Search:
    """One env's layout."""

    context: PlacementContext
    """Of the env: robots, and what the layout says nothing of, have their places already and keep them."""
    clearance: ClearanceQuery
    sampler: Callable[[PlacementTask, int], PlacementSampler]
    """The numbers of an attempt."""
    bounds: RepairSpec = field(default_factory=RepairSpec)
    """How far proposed poses may be moved."""

    def solve(self, tasks: Sequence[PlacementTask]) -> dict[str, Candidate]:
        """A place for each, by the names of the items. `tasks` come in an order in which references come first.

        Raises:
            NoPlace: one of them has none.
            RefusedProposal: proposed poses cannot be kept; a sentence for each.
        """
        self._constraints = Constraints(self.context, self.clearance)
        found: dict[str, Candidate] = {}
        order, done = list(tasks), 0
        for task in tasks:
            self.context.places[task.item.name] = task.place
        retreats = 0
        refused: list[str] = []
        while done < len(order):
            task = order[done]
            if task.proposed is not None:
                kept_pose = self._repaired(task, task.proposed)
                if isinstance(kept_pose, str):
                    refused.append(f"'{task.item.name}' {kept_pose}")
                else:
                    self._settle(task, kept_pose, found)
                done += 1
                continue
            if refused:  # the rest would be judged without those
                done += 1
                continue
            result, reasons = self._place(task)
            if result is None and retreats < RETREATS:
                culprit = self._culprit(task, order[:done], reasons)
                if culprit is not None:
                    retreats += 1
                    leaving = self._with_dependents(order[culprit], order[:done])
                    for gone in leaving:
                        self._remove(gone, found)
                    kept = [t for t in order[:done] if t not in leaving]
                    order = [*kept, task, *leaving, *order[done + 1 :]]
                    done = len(kept)
                    continue
            if result is None:
                rescued = self._pack_together(task, order[:done], found)
                if rescued is None:
                    raise NoPlace(self._sentence(task, reasons))
                done += 1
                continue
            self._settle(task, result, found)
            done += 1
        if refused:
            raise RefusedProposal("; ".join(refused))
        return found

    # ------------------------------------------------------------------ one thing

    def _place(self, task: PlacementTask) -> tuple[Candidate | None, Counter[Objection]]:
        reasons: Counter[Objection] = Counter()
        self.context.by = task.item
        if task.place.arrange == "pack":
            return self._packed(task, reasons), reasons
        for _ in range(1 if task.constant else ATTEMPTS):
            sampler = self.sampler(task, task.tick)
            proposed = candidate(task.solid, task.place, sampler, self.context)
            task.tick += 1
            if isinstance(proposed, Impossible):
                reasons[Objection(proposed.reason, None, absent=True)] += 1
                if proposed.hopeless:
                    break
                continue
            wrong = self._constraints.objection(task, proposed)
            if wrong is None:
                sampler.keep()
                return proposed, reasons
            reasons[wrong] += 1
        return None, reasons

    def _repaired(self, task: PlacementTask, proposed: ProposedPose) -> Candidate | str:
        """The proposed pose within the bounds, or what is wrong with it in words after the name."""
        self.context.by = task.item
        first = repair.start(task, proposed, self.bounds, self.context)
        if isinstance(first, str):
            return first

        def objection(one: Candidate) -> str | None:
            wrong = self._constraints.objection(task, one)
            return None if wrong is None else wrong.reason

        found = repair.repaired(first, self.bounds, objection)
        if isinstance(found, str):
            near = f", and no place within {self.bounds.distance:g} m is free" if self.bounds.distance > 0 else ""
            return f"{found}{near}"
        return found

    def _settle(self, task: PlacementTask, chosen: Candidate, found: dict[str, Candidate]) -> None:
        name = task.item.name
        found[name] = chosen
        self.context.settled[name] = SettledObject(
            chosen.placed, task.solid.fixed, task.constant, task.solid.collides, True
        )

    def _remove(self, task: PlacementTask, found: dict[str, Candidate]) -> None:
        found.pop(task.item.name, None)
        self.context.settled.pop(task.item.name, None)

    # ------------------------------------------------------------------ going back

    def _culprit(
        self, task: PlacementTask, before: Sequence[PlacementTask], reasons: Mapping[Objection, int]
    ) -> int | None:
        """The rank of what is most in the way and may go elsewhere; None where nothing is."""
        ranks = {t.item.name: k for k, t in enumerate(before)}
        needed = self._needs(task, before)
        votes: Counter[int] = Counter()
        for objection, count in reasons.items():
            rank = ranks.get(objection.blocker or "")
            if rank is not None and not before[rank].constant and before[rank].proposed is None:
                if before[rank].item.name not in needed and before[rank].place.arrange != "pack":
                    votes[rank] += count
        return max(votes, key=lambda rank: (votes[rank], rank)) if votes else None

    def _needs(self, task: PlacementTask, before: Sequence[PlacementTask]) -> set[str]:
        """The things that a place depends on, and what these depend on."""
        by_name = {t.item.name: t for t in before}
        needed: set[str] = set()
        waiting = [task]
        while waiting:
            one = waiting.pop()
            for _, reference in one.place.references():
                for item in meant(reference, self.context.items, one.item):
                    if item.name not in needed and item.name in by_name:
                        needed.add(item.name)
                        waiting.append(by_name[item.name])
        return needed

    def _with_dependents(self, task: PlacementTask, placed: Sequence[PlacementTask]) -> list[PlacementTask]:
        return [t for t in placed if t is task or task.item.name in self._needs(t, placed)]

    # ------------------------------------------------------------------ packing

    def _packed(self, task: PlacementTask, reasons: Counter[Objection]) -> Candidate | None:
        """The first place in rows, with the drawn turn that takes the least room."""
        return packed(
            self._turns(task),
            lambda proposed: self._objected(task, proposed, reasons),
            [s.placed for s in self.context.settled.values() if s.listed],  # rows are built against these
            max(GAP, task.place.clearance),
        )

    def _objected(self, task: PlacementTask, proposed: Candidate, reasons: Counter[Objection]) -> bool:
        wrong = self._constraints.objection(task, proposed)
        if wrong is not None:
            reasons[wrong] += 1
        return wrong is not None

    def _turns(self, task: PlacementTask) -> list[tuple[Candidate, PlacementSampler]]:
        """Some of the orientations that the entry allows, the slimmest first; each as a candidate somewhere."""
        found: list[tuple[Candidate, PlacementSampler]] = []
        for tick in range(1 if task.constant else 8):
            sampler = self.sampler(task, tick)
            proposed = candidate(task.solid, task.place, sampler, self.context)
            if isinstance(proposed, Candidate) and proposed.area:
                found.append((proposed, sampler))
        return sorted(found, key=lambda pair: round(_footprint(pair[0]), 9))

    def _pack_together(
        self, task: PlacementTask, before: Sequence[PlacementTask], found: dict[str, Candidate]
    ) -> Candidate | None:
        """What goes anywhere on the same support, the largest first, in rows; undone where that fails too."""
        if not _scattered(task):
            return None
        group = [
            t for t in before if _scattered(t) and _support(t) == _support(task) and t.place.region == task.place.region
        ]
        group = [t for t in group if not any(t.item.name in self._needs(o, before) for o in before)]
        kept = {t.item.name: (found[t.item.name], self.context.settled[t.item.name]) for t in group}
        for one in group:
            self._remove(one, found)
        sized = [(self._size(one), one) for one in (*group, task)]
        reasons: Counter[Objection] = Counter()
        for _, one in sorted(sized, key=lambda pair: (-pair[0], pair[1].item.name)):
            self.context.by = one.item
            chosen = self._packed(one, reasons)
            if chosen is None:
                for t in (*group, task):
                    self._remove(t, found)
                for name, before_packing in kept.items():
                    found[name], self.context.settled[name] = before_packing
                return None
            self._settle(one, chosen, found)
        return found[task.item.name]

    def _size(self, task: PlacementTask) -> float:
        self.context.by = task.item
        turns = self._turns(task)
        return round(_footprint(turns[0][0]), 9) if turns else 0.0

    # ------------------------------------------------------------------ words

    def _sentence(self, task: PlacementTask, reasons: Mapping[Objection, int]) -> str:
        name = task.item.name
        total = sum(reasons.values())
        if len(reasons) == 1 and next(iter(reasons)).absent:
            return f"'{name}' cannot be placed: {next(iter(reasons)).reason}; see {task.path}"
        ordered = sorted(reasons.items(), key=lambda pair: (-pair[1], pair[0].reason))
        main = ordered[0][0]
        how = {True: f"{total} draws" if total > 1 else "its place", False: "rows"}[task.place.arrange == "scatter"]
        if main.reason.startswith("cannot keep its clearance"):
            first = f"no place for '{name}' in {how} that keeps{main.reason.removeprefix('cannot keep')}"
        elif main.absent:
            first = f"no place for '{name}' in {how}: {main.reason}"
        else:
            first = f"no place for '{name}' in {how}: it {main.reason}"
        others = [o.reason for o, _ in ordered[1:4] if not o.absent]
        more = f", or it {', or '.join(others)}" if others else ""
        remedy = f"widen {task.path}" if not task.constant else f"change {task.path}"
        if "clearance" in main.reason:
            remedy += " or lower its clearance"
        return f"{first}{more}{self._free_room(task)}; {remedy}"

    def _free_room(self, task: PlacementTask) -> str:
        """How much of its support is free, in words."""
        reference = task.place.in_ or task.place.on
        if reference is None or reference == "terrain":
            return ""
        self.context.by = task.item
        areas = standing_areas_of(reference, task.place.in_ is not None, self.context)
        if isinstance(areas, Impossible) or not any(f.area for f in areas):
            return ""
        whole, free = free_area(areas, self.context.settled.values())
        return f" (of the {whole:.3g} m^2 of '{reference}' {free:.3g} m^2 are free)"


def _footprint(found: Candidate) -> float:
    low, high = found.placed.low, found.placed.high
    return (high[0] - low[0]) * (high[1] - low[1])


def _support(task: PlacementTask) -> tuple[str | None, str | None]:
    return task.place.on, task.place.in_


def _scattered(task: PlacementTask) -> bool:
    """Whether it goes anywhere on a support or in a region, without further relations."""
    place = task.place
    related = (place.near, place.left_of, place.right_of, place.in_front_of, place.behind, place.aligned, place.facing)
    free = place.position is None and place.x is None and place.y is None and task.proposed is None
    return free and not any(related) and (place.on is not None or place.in_ is not None)


def is_constant(place: PlaceFields) -> bool:
    """Whether nothing is drawn for a place."""
    if any(isinstance(getattr(place, name), Distribution) for name in ("position", "x", "y", "roll", "pitch", "yaw")):
        return False
    return place.rest == "given" and (place.position is not None or place.x is not None or place.y is not None)
