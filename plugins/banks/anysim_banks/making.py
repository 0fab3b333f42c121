"""The making of a bank: sample, filter, try in physics, keep what differs, and try that on the other engines."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from anysim.conventions import Array
from anysim.engine.factory import availability
from anysim.errors import AssetError
from anysim.skills.bank import Bank
from anysim_banks.diversity import diverse
from anysim_banks.method import Method
from anysim_banks.reach import Base, Reach
from anysim_banks.sampling import Candidates
from anysim_banks.subject import Subject
from anysim_banks.trial import CREEP

Say = Callable[[str], object]
FEW = 2
"""The hard test is for so many times as many as are kept, as different as they can be."""
SAFE = 2.0
"""Grasps that hold so many times the easy test's load are kept alone, where there are any: engines differ a little."""
_POSE_DIGITS = 9


@dataclass(frozen=True)
class Order:
    """How many grasps are sampled, how many are kept, the seed, and a robot that is to reach them, from where."""

    raw: int = 2000
    keep: int = 64
    seed: int = 0
    robot: str = ""
    bases: tuple[Base, ...] = ()

    @property
    def asked(self) -> list[object]:
        """What makes another bank of the same subject and seed."""
        return [self.raw, self.keep, *([self.robot, [list(base) for base in self.bases]] if self.robot else [])]


def made(
    method: Method, engine: str, order: Order, say: Say, about: Mapping[str, object] | None = None
) -> tuple[Bank, float]:
    """A new bank, tried on one engine, and how many raw candidates were judged per CPU second.

    `about` is added to its provenance.

    Raises:
        AssetError: nothing that was sampled could be held; says what became of it.
    """
    began, subject = process_time(), method.subject
    rng = np.random.default_rng([order.seed, int(subject.hash[:8], 16), int(subject.place[:8], 16)])
    found = method.sampled(order.raw, rng)
    raw = len(found.width)
    free = found.take(np.flatnonzero(method.free(found)))
    clear = len(free.width)
    say(f"{clear} of {raw} are free of collision")
    standing: dict[str, object] = {}
    if order.robot and isinstance(subject, Subject):
        free, standing = _within_reach(free, subject, order, rng)
        say(f"{len(free.width)} of those within reach of {order.robot}")
    with method.trial(engine) as trial:
        easy = trial.run(free, hard=False)
        held = np.flatnonzero(easy.margin >= 1.0)
        tried = held[diverse(free.take(held), easy.margin[held], FEW * order.keep)]
        margin = trial.run(free.take(tried)).margin
        if (margin >= SAFE).any():
            tried, margin = tried[margin >= SAFE], margin[margin >= SAFE]
        spread, best = diverse(free.take(tried), margin, len(tried)), np.zeros(0, dtype=int)
        while len(best) < order.keep and len(spread):
            few, spread = spread[: order.keep], spread[order.keep :]
            best = np.concatenate([best, few[trial.lasting(free.take(tried[few]), CREEP)]])[: order.keep]
    rate = raw / max(process_time() - began, 1e-9)
    say(f"{len(held)} held on {engine}, {int(easy.missed.sum())} missed")
    if len(best) == 0:
        raise AssetError(method.failed(raw, clear, len(held)))
    kept = tried[best]
    counts: dict[str, object] = {
        "raw": raw,
        "free": clear,
        "held": len(held),
        "kept": len(kept),
        "seed": order.seed,
        "asked": order.asked,
        "place": subject.place,
        "link": subject.link,
        **method.about(),
        **standing,
        **(about or {}),
    }
    bank = Bank(
        subject.asset,
        subject.affordance.name,
        method.tool.name,
        subject.hash,
        method.tool.hash,
        np.round(free.pose[kept], _POSE_DIGITS),
        np.round(free.width[kept], _POSE_DIGITS),
        tuple(str(kind) for kind in free.kind[kept]),
        np.round(margin[best], 3),
        {stamp(engine): np.ones(len(kept), dtype=bool)},
        counts,
    )
    return _best_first(bank), rate


def _within_reach(
    free: Candidates, subject: Subject, order: Order, rng: np.random.Generator
) -> tuple[Candidates, dict[str, object]]:
    """What of the candidates the robot reaches, and where it stands, for the bank's provenance."""
    found = Reach(order.robot, order.bases).of(subject, free.pose, rng)
    stands = {"bases": [list(base) for base in found.bases], "reached": found.grasps.sum(axis=1).tolist()}
    return free.take(np.flatnonzero(found.grasps.any(axis=0))), {"robot": order.robot, **stands}


def tried_on(bank: Bank, method: Method, engines: Sequence[str], say: Say) -> Bank:
    """The bank with marks of what is held on more engines; those that it was tried on already are passed over."""
    for engine in engines:
        if stamp(engine) in bank.passed:
            continue
        width = bank.width
        grasps = Candidates(bank.pose, width, np.array(bank.kind), np.zeros(len(width), dtype=int))
        with method.trial(engine) as trial:
            margin = trial.run(grasps).margin
            held = (margin >= 1.0) & trial.lasting(grasps)
        passed: dict[str, Array] = {**bank.passed, stamp(engine): held}
        bank = replace(bank, margin=np.round(np.minimum(bank.margin, margin), 3), passed=passed)
        say(f"{int(held.sum())} of {len(width)} held on {engine}")
    return _best_first(bank)


def stamp(engine: str) -> str:
    """An engine with its version: `mujoco 3.3.7`."""
    return f"{engine} {availability(engine).version}"


def _best_first(bank: Bank) -> Bank:
    return bank.take(np.argsort(-bank.margin, kind="stable"))
