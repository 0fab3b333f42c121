"""Candidate banks: grasps of one affordance with one gripper, tried in physics, as skills read them.

Tool poses are in the frame of the body that the affordance is on: z moves onto the thing, y is where fingers close.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from anysim.assets.bounded_files import bounded
from anysim.conventions import Array
from anysim.errors import AssetError, listing
from anysim.math import pose as P
from anysim_schemas.limits import JSON_BYTES

FORMAT = "anysim-bank-1"
_DIGITS = 9  # a nanometre
_KEYS = frozenset({"pose", "width", "kind", "margin", "passed"})


@dataclass(frozen=True, eq=False)
class Bank:
    """The candidates of one affordance, best first.

    Attributes:
        asset: what it was made for, such as `procedural:cabinet`.
        affordance: such as `drawer_1.handle`.
        gripper: which hand, with what it was built of.
        asset_hash, gripper_hash: digests of what was tried; a bank does not hold for anything else.
        pose: (G, 7) tool poses in the body's frame [m].
        width: (G,) what the fingers close on [m].
        kind: (G,) which shape was taken hold of, and how, such as `box` or `cylinder cap`.
        margin: (G,) the multiple of the easy test's load at which the grasp gave way, the least of all engines.
        passed: for each engine tried, with its version, (G,) bool: the easy test was passed.
        provenance: counts, seed and settings of the making.
    """

    asset: str
    affordance: str
    gripper: str
    asset_hash: str
    gripper_hash: str
    pose: Array
    width: Array
    kind: tuple[str, ...]
    margin: Array
    passed: Mapping[str, Array]
    provenance: Mapping[str, object] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.pose)

    @property
    def version(self) -> str:
        """A digest of the candidates: what counts and manifests refer to."""
        text = json.dumps(self.document()["candidates"], sort_keys=True)
        return hashlib.sha256(f"{self.asset_hash} {self.gripper_hash} {text}".encode()).hexdigest()[:16]

    @property
    def approach(self) -> Array:
        """(G, 3) the directions in which the tool moves onto the thing, in the body's frame."""
        return P.rotate(self.pose[:, 3:], np.array([0.0, 0.0, 1.0]))

    def goal_set(
        self, body_pose: Array, count: int | None = None, *, engine: str = "", belief: Array | None = None
    ) -> Array:
        """Tool poses in the world, best first: of one body (7,) -> (G, 7), of several (n, 7) -> (n, G, 7).

        Args:
            body_pose: where the affordance's body is.
            count: at most so many.
            engine: only those that have passed on it, by name with or without a version; empty: all.
            belief: (G,) factors on the margins, such as those of a living bank.

        Raises:
            AssetError: the bank was not tried on that engine.
        """
        poses = self.pose[self.ranked(engine, belief)[:count]]
        return P.compose(np.asarray(body_pose)[..., None, :], poses)

    def ranked(self, engine: str = "", belief: Array | None = None) -> Array:
        """Indices of the candidates, best first; see `goal_set`."""
        score = self.margin if belief is None else self.margin * belief
        order = np.argsort(-score, kind="stable")
        return order[self.passed_on(engine)[order]] if engine else order

    def passed_on(self, engine: str) -> Array:
        """(G,) bool: what has passed on an engine, by name with or without a version."""
        for name, passed in self.passed.items():
            if engine in (name, name.split(" ")[0]):
                return passed
        raise AssetError(
            f"the bank of {self.asset} {self.affordance} was not tried on '{engine}' (on: {listing(self.passed)}); "
            f"add it with `anysim bank build … --engine {engine}`"
        )

    def take(self, which: Sequence[int] | Array) -> "Bank":
        """Some of the candidates, in this order."""
        at = np.asarray(which, dtype=int)
        return replace(
            self,
            pose=self.pose[at],
            width=self.width[at],
            kind=tuple(self.kind[i] for i in at),
            margin=self.margin[at],
            passed={name: rows[at] for name, rows in self.passed.items()},
        )

    def document(self) -> dict[str, object]:
        """The bank as JSON has it."""
        names = ("asset", "affordance", "gripper", "asset_hash", "gripper_hash")
        rows = [
            {
                "pose": np.round(self.pose[i], _DIGITS).tolist(),
                "width": round(float(self.width[i]), _DIGITS),
                "kind": self.kind[i],
                "margin": round(float(self.margin[i]), 3),
                "passed": [name for name, passed in self.passed.items() if passed[i]],
            }
            for i in range(len(self))
        ]
        about = {name: getattr(self, name) for name in names}
        return (
            {"format": FORMAT}
            | about
            | {"engines": list(self.passed), "provenance": dict(self.provenance), "candidates": rows}
        )


def read_bank(path: Path) -> Bank:
    """The bank in a JSON file.

    Raises:
        AssetError: there is no such file, or it holds no bank of this format.
    """
    if not path.exists():
        raise AssetError(f"there is no bank at {path}; make one with `anysim bank build`")
    try:
        data = json.loads(bounded(path, JSON_BYTES))
        if data["format"] != FORMAT:
            raise AssetError(f"{path} is of the format {data['format']!r}, not {FORMAT!r}; build it anew")
        rows, engines = data["candidates"], data["engines"]
        if bad := [i for i, row in enumerate(rows) if set(row) != _KEYS or len(row["pose"]) != 7]:
            raise ValueError(f"candidate {bad[0]} needs the keys {listing(sorted(_KEYS))}, a pose of 7 numbers")
        return Bank(
            *(str(data[k]) for k in ("asset", "affordance", "gripper", "asset_hash", "gripper_hash")),
            pose=np.array([row["pose"] for row in rows], dtype=np.float64).reshape(-1, 7),
            width=np.array([row["width"] for row in rows], dtype=np.float64),
            kind=tuple(str(row["kind"]) for row in rows),
            margin=np.array([row["margin"] for row in rows], dtype=np.float64),
            passed={str(e): np.array([e in row["passed"] for row in rows], dtype=bool) for e in engines},
            provenance=data["provenance"],
        )
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise AssetError(f"{path} holds no bank ({type(error).__name__}: {error}); build it anew") from None
