"""The building of the banks of an asset or a task, one affordance after the other."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from anysim import registry
from anysim.api import compile_world
from anysim.errors import AssetError
from anysim.model.affordance_lookup import affordances_of
from anysim.model.affordances import AffordanceKind
from anysim.model.world import EntityKind, World
from anysim.skills.bank import Bank
from anysim_banks.anchors import Anchor, anchored, read_anchors
from anysim_banks.gripper import gripper as gripper_by_name
from anysim_banks.hand import hand
from anysim_banks.hand_grasps import HandGrasps
from anysim_banks.insertion import insertions
from anysim_banks.making import Order, made, stamp, tried_on
from anysim_banks.method import Grasps, Method
from anysim_banks.reach import Base
from anysim_banks.store import bank_path, stored, write
from anysim_banks.subject import Subject, graspable, subjects
from anysim_schemas.object_source import MESH_ENDINGS, PROCEDURAL

_ASSETS = (".urdf", ".xml", ".mjcf", *MESH_ENDINGS)


class Wish(NamedTuple):
    """What is to be built, as the command says it."""

    what: str
    object: str = ""
    affordance: str = ""
    engines: tuple[str, ...] = ("mujoco",)
    gripper: str = "parallel_gripper"
    raw: int = 2000
    keep: int = 64
    seed: int = 0
    anchors: Path | None = None
    out: Path = Path("banks")
    robot: str = ""
    bases: tuple[Base, ...] = ()


class Work(NamedTuple):
    """One bank to be made."""

    name: str
    method: Method
    anchor: Anchor | None = None
    source: str = ""


class Row(NamedTuple):
    """What became of one: the bank and its file, or None and why not; raw candidates per CPU second, 0 if not made."""

    name: str
    bank: Bank | None
    path: Path
    rate: float
    line: str

    def cells(self, engines: Sequence[str]) -> tuple[object, ...]:
        """Cells of a table."""
        assert self.bank is not None  # rows without one are not shown
        p = self.bank.provenance
        passed = [int(self.bank.passed_on(engine).sum()) for engine in engines]
        rate = f"{self.rate:.0f}" if self.rate else "there"
        best = f"{self.bank.margin.max():.1f}"
        return (self.name, p["raw"], p["free"], p["held"], len(self.bank), *passed, best, rate, self.path)

    def summary(self) -> dict[str, object]:
        """For a JSON document."""
        if self.bank is None:
            return {"affordance": self.name, "failed": self.line}
        return {
            "affordance": self.name,
            "file": str(self.path),
            "version": self.bank.version,
            "kept": len(self.bank),
            "passed": {engine: int(rows.sum()) for engine, rows in self.bank.passed.items()},
            "raw_per_cpu_second": round(self.rate, 1),
            **self.bank.provenance,
        }


def works(wish: Wish) -> list[Work]:
    """All banks that a wish is about.

    Raises:
        AssetError: nothing in it affords a grasp.
        AnysimError: the asset or task cannot be had; a name does not exist.
    """
    world, names = _world(wish.what)
    grasps = _grasps(wish.gripper)
    chosen = [wish.object] if wish.object else names
    if wish.anchors is not None:
        if len(chosen) != 1:
            raise AssetError(f"anchors are on one object; name it with --object (objects: {', '.join(chosen)})")
        document = read_anchors(wish.anchors)
        pairs = anchored(world, chosen[0], document)
        return [Work(chosen[0], grasps(subject), anchor, document.spec.source) for subject, anchor in pairs]
    found: list[Work] = []
    for name in chosen:
        holes = _holes(world, name, wish.affordance)
        into = list(insertions(world, name, wish.affordance)) if holes else []
        closed_on = not holes or (not wish.affordance and bool(graspable(world, world.entity_numbers[name])))
        if not closed_on and (wish.robot or not into) and (wish.object or wish.affordance):
            raise AssetError(_no_insertions(holes[0], wish))
        found += [Work(name, grasps(one)) for one in (subjects(world, name, wish.affordance) if closed_on else ())]
        found += [Work(name, one) for one in ([] if wish.robot else into)]
    if not found:
        raise AssetError(
            f"nothing in '{wish.what}' affords a grasp, or a hole for a tip: free objects and what builders declare do"
        )
    return found


def _holes(world: World, name: str, only: str) -> list[str]:
    """The holes of an object, each as `object.hole`, or the one that is named."""
    number = world.entity_numbers.get(name)
    known = [] if number is None else affordances_of(world, number)
    return [f"{name}.{a.name}" for a in known if a.kind is AffordanceKind.HOLE and only in ("", a.name)]


def _no_insertions(hole: str, wish: Wish) -> str:
    """Why no bank is made of a hole."""
    if wish.robot:
        return (
            f"{hole} is a hole: what {wish.robot} reaches there follows from how it holds what goes in, so --robot is "
            "for banks of grasps alone; drop it, or name what is grasped with --object"
        )
    return (
        f"nothing free in '{wish.what}' has a tip that goes into {hole}; a hole that is itself brought over a peg, as "
        "that of a nut, has no bank: `insert` takes its turns from `symmetry`"
    )


def build_all(todo: Sequence[Work], wish: Wish) -> Iterator[Row]:
    """Make, or complete, one bank after the other; each is written as soon as an engine is done with it."""
    order = Order(wish.raw, wish.keep, wish.seed, wish.robot, wish.bases)
    for work in todo:
        path = bank_path(wish.out, work.name, work.method, wish.robot)
        name = f"{work.name}.{work.method.subject.affordance.name}"
        said: list[str] = []
        bank, rate = stored(path, work.method, order), 0.0
        if bank is not None and stamp(wish.engines[0]) not in bank.passed:
            bank = None  # the first engine decides what is in it
        try:
            if bank is None:
                about: dict[str, object] = {}
                if work.anchor is not None:
                    about = {"anchors": work.source, "prior": work.anchor.prior, "use": list(work.anchor.use)}
                bank, rate = made(work.method, wish.engines[0], order, said.append, about)
                write(path, bank)
            for engine in wish.engines[1:]:
                bank = tried_on(bank, work.method, [engine], said.append)
                write(path, bank)
        except AssetError as error:
            yield Row(name, None, path, 0.0, f"{name}: {error}")
            continue
        yield Row(name, bank, path, rate, f"{name}: {', '.join(said) or 'there already'}")


def _grasps(name: str) -> Callable[[Subject], Method]:
    """Grasps with a robot's hand, or with a procedural gripper."""
    if name in registry.names("robots"):
        fingers = hand(name)
        return lambda subject: HandGrasps(subject, fingers)
    gripper = gripper_by_name(name)
    return lambda subject: Grasps(subject, gripper)


def _world(what: str) -> tuple[World, list[str]]:
    """The World of a task, or of one asset alone, and its objects that afford a grasp or have a hole."""
    if what.lstrip().startswith("{"):
        world = compile_world({}, overrides=[f"world.objects.object.source={what}"])
    elif what.startswith(PROCEDURAL) or what.lower().split("#")[0].endswith(_ASSETS):
        stem = Path(what.removeprefix(PROCEDURAL).split("#")[0]).stem
        name = "".join(c if c.isalnum() else "_" for c in stem.split(":")[-1])
        world = compile_world({"world": {"objects": {name: {"source": what}}}}, base=Path.cwd())
    else:
        world = compile_world(what)
    names = [
        entity.name
        for number, entity in enumerate(world.entities)
        if entity.kind is EntityKind.OBJECT
        and (graspable(world, number) or any(a.kind is AffordanceKind.HOLE for a in affordances_of(world, number)))
    ]
    return world, names
