"""Banks of an object from files: those that hold for what it is, for the gripper and the engine, and their counts."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from anysim.conventions import Array
from anysim.errors import AssetError, SpecError, SpecIssue, listing
from anysim.model.affordance_lookup import asset_hash
from anysim.model.world import Entity
from anysim.skills.bank import Bank, read_bank
from anysim.skills.living_bank import LivingBank
from anysim.task.env import TaskEnv
from anysim.task.scene import ObjectView

SAME_STROKE = 0.01
"""[m] by which the bank's gripper and the arm's may open differently."""
KEYS = ("bank", "pinned")
"""The parameters of a skill at which it is told what does not fit."""
_NOTHING = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def refuse_counts(bank: Path | None, living: Path | None, pinned: str, keys: tuple[str, str] = KEYS) -> None:
    """Refuse counts, or a version of them, where there is no bank whose candidates they would be of.

    Raises:
        SpecError: at `living`, or at the second of `keys`.
    """
    given = "living" if living is not None else keys[1] if pinned else ""
    if bank is None and given:
        words = f"outcomes are counted of the candidates of a bank, but there is no `{keys[0]}`; make one with "
        raise _at(given, f"{words}`anysim bank build` and name it at `{keys[0]}`, or drop `{given}`")


class Fit(Protocol):
    """What a bank must be for."""

    def holds(self, bank: Bank) -> bool:
        """Whether it is."""
        ...

    def otherwise(self, banks: Sequence[Bank]) -> tuple[str, str]:
        """What is wrong with banks that are not, and what the command that makes one is to be told besides."""
        ...


class OfGripper(NamedTuple):
    """For a gripper with two fingers that opens so wide [m]."""

    aperture: float

    def holds(self, bank: Bank) -> bool:
        return abs(_stroke(bank) - self.aperture) <= SAME_STROKE

    def otherwise(self, banks: Sequence[Bank]) -> tuple[str, str]:
        has = listing(sorted({f"{bank.gripper}, which opens {_stroke(bank):g} m" for bank in banks}))
        words = f"is for another gripper ({has}); this one opens {self.aperture:g} m"
        return words, f" --gripper parallel_gripper:stroke={self.aperture:g}"


class Banks:
    """The candidates of each entity that an object can be, from one bank or several.

    Attributes:
        pose: (E, G, 7) tool poses in the frame of the body that is held; what an entity has fewer of is filled up.
        width: (E, G) [m].
        kind: for each entity the kinds of its candidates.
        score: (E, G) the higher the better; -infinite where nothing is, or did not pass on this engine.
        about: versions of the banks and of their counts, for records.
        keys: those of `bank` and `pinned` among a skill's parameters.
    """

    def __init__(
        self,
        env: TaskEnv,
        fit: Fit,
        object: ObjectView,
        path: Path,
        living: Path | None,
        pinned: str,
        body: int | None = None,
        keys: tuple[str, str] = KEYS,
    ) -> None:
        """As of `BankedGrasps`."""
        self._env, self._fit, self._object, self._path, self._body = env, fit, object, path, body
        self.keys = keys
        if pinned and living is None:
            raise _at(keys[1], "counts are pinned, but none are kept; say where they are with `living`")
        found = self._read()
        used = [self._of(entity, found) for entity in object.entities]
        # `anysim check` tries the task on the kinematic engine, for the one that the file names
        engine = env.engine.name if env.engine.name != "null" else env.spec.engine.name
        self._counts: list[list[LivingBank]] = []
        self._start: list[list[int]] = []
        most = max(sum(map(len, banks)) for banks in used)
        shape = (len(used), most)
        self.pose, self.width, self.score = (
            np.tile(_NOTHING, (*shape, 1)),
            np.full(shape, np.inf),
            np.full(shape, -np.inf),
        )
        self.kind = [[kind for bank in banks for kind in bank.kind] for banks in used]
        for row, banks in enumerate(used):
            counts = [LivingBank(bank, engine, living) for bank in banks] if living is not None else []
            ends = np.cumsum([len(bank) for bank in banks])
            self._counts.append(counts)
            self._start.append([0, *ends[:-1].tolist()])
            self.pose[row, : ends[-1]] = np.concatenate([bank.pose for bank in banks])
            self.width[row, : ends[-1]] = np.concatenate([bank.width for bank in banks])
            beliefs = [count.belief for count in counts] or [np.ones(len(bank)) for bank in banks]
            scores = [bank.margin * belief * _prior(bank) for bank, belief in zip(banks, beliefs, strict=True)]
            passed = np.concatenate([self._passed(bank, engine) for bank in banks])
            self.score[row, : ends[-1]] = np.where(passed, np.concatenate(scores), -np.inf)
        self._pinned = bool(pinned)
        self.about: dict[str, str | int] = {"version": _digest([bank.version for banks in used for bank in banks])}
        if living is not None:
            counted = _digest([count.version for counts in self._counts for count in counts])
            self.about["counts"] = counted
            if pinned and counted != pinned:
                words = (
                    f"the counts in {living} are of version {counted}, pinned is '{pinned}': outcomes were added since"
                )
                raise _at(keys[1], f"{words}; restore them, or drop the pin")

    def note(self, which: int, number: int, success: bool) -> None:
        """An outcome of a candidate of an entity, if outcomes are kept."""
        if self._counts[which]:
            bank = int(np.searchsorted(self._start[which], number, side="right")) - 1
            self._counts[which][bank].note(number - self._start[which][bank], success)

    def save(self) -> None:
        """Add the outcomes to their files."""
        for counts in [] if self._pinned else self._counts:
            for count in counts:
                count.save()

    def _read(self) -> list[Bank]:
        """All banks at the path."""
        files = sorted(self._path.glob("*.json")) if self._path.is_dir() else [self._path]
        try:
            found = [read_bank(file) for file in files]
        except AssetError as error:
            raise _at(self.keys[0], str(error)) from None
        if not found:
            raise _at(self.keys[0], f"there are no banks in the folder {self._path}; make one with `anysim bank build`")
        return found

    def _of(self, entity: Entity, found: list[Bank]) -> list[Bank]:
        """The banks of an entity."""
        world = self._env.engine.world
        held = entity.root if self._body is None else self._body
        own, link = asset_hash(world, entity, held), held - entity.body_start
        banks = [bank for bank in found if (bank.asset_hash, _link(bank)) == (own, link)]
        more = f"build one with `anysim bank build {self._env.name} --object {self._object.name}`"
        if not banks:
            has = listing([f"{bank.affordance} of {bank.asset}" for bank in found])
            name = world.bodies[held].name if link else entity.name
            words = f"{self._path} holds no bank of '{name}' as it is here, of the digest {own[:12]}"
            same = "shapes, surfaces, mass, joints and the link that is held"
            raise _at(self.keys[0], f"{words}: {same} must be the same (banks: {has}); {more}")
        fit = [bank for bank in banks if self._fit.holds(bank)]
        if not fit:
            words, besides = self._fit.otherwise(banks)
            raise _at(self.keys[0], f"{self._path} {words}; {more}{besides}")
        return fit

    def _passed(self, bank: Bank, engine: str) -> Array:
        try:
            return bank.passed_on(engine)
        except AssetError as error:
            raise _at(self.keys[0], str(error)) from None


def _stroke(bank: Bank) -> float:
    stroke = bank.provenance.get("stroke")
    return float(stroke) if isinstance(stroke, int | float) else float("nan")


def _link(bank: Bank) -> int:
    """Which of its asset's links it is on; 0 is the root."""
    link = bank.provenance.get("link", 0)
    return link if isinstance(link, int) else -1


def _prior(bank: Bank) -> float:
    """How fit its region is thought for its use, by who proposed it."""
    prior = bank.provenance.get("prior", 1.0)
    return float(prior) if isinstance(prior, int | float) else 1.0


def _digest(versions: list[str]) -> str:
    """The version of all of them: that of the only one where there is one."""
    if len(versions) == 1:
        return versions[0]
    return hashlib.sha256(" ".join(versions).encode()).hexdigest()[:16]


def _at(key: str, words: str) -> SpecError:
    return SpecError([SpecIssue("", key, words)])
