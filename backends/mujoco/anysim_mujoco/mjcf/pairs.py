"""The pairs of neutral bodies that never collide, of what an MJCF file says of bodies and geoms.

MuJoCo filters geoms by masks, and bodies before rigid ones are lumped; the neutral model knows pairs of whole bodies.
Where those differ a pair collides, unless shapes that the file excludes from each other overlap from the start. Of
geoms that a file pairs (`<pair>`) the report says what is lost.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import mujoco
import numpy as np

from anysim.assets.model import ImportNote
from anysim.errors import listing
from anysim.model.world import Body
from anysim_mujoco.mjcf.geoms import GeomReader

_MEASURED = 1000
"""Distances of shapes that are measured, at most."""
_UNMEASURED = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)


class PairReader:
    """Reads the pairs of one model; `links` are the names of MuJoCo's bodies."""

    def __init__(
        self,
        model: mujoco.MjModel,
        geometry: GeomReader,
        bodies: Sequence[Body],
        links: Sequence[str],
        notes: list[ImportNote],
    ) -> None:
        self._model, self._links, self._notes, self._bodies = model, links, notes, bodies
        self._apart = {frozenset((int(n) >> 16, int(n) & 0xFFFF)) for n in model.exclude_signature}
        self._shapes: dict[int, list[int]] = {}
        for geom, number in zip(geometry.geoms, geometry.numbers, strict=True):
            if geom.collides:
                self._shapes.setdefault(geom.body, []).append(number)
        self._data: mujoco.MjData | None = None
        self._left = _MEASURED

    def excluded(self, virtual: Mapping[int, int]) -> frozenset[tuple[int, int]]:
        """Pairs (low, high) of neutral bodies; `virtual`: extra links of bodies with several joints."""
        parents = [body.parent for body in self._bodies]
        pairs: set[tuple[int, int]] = set()
        for body in set(virtual.values()):  # a body and its parent do not collide, however many joints are between
            parent = parents[body]
            while parent in virtual:
                parent = parents[parent]
            if parent in self._shapes and body in self._shapes:
                pairs.add((parent, body))
        for low, ours in self._shapes.items():
            for high, theirs in self._shapes.items():
                if low < high and parents[high] != low and (low, high) not in pairs and self._pass(ours, theirs):
                    pairs.add((low, high))
        return frozenset(pairs)

    def _pass(self, ours: Sequence[int], theirs: Sequence[int]) -> bool:
        """Whether two bodies pass through each other."""
        model = self._model
        ends = [{int(model.geom_bodyid[g]) for g in geoms} for geoms in (ours, theirs)]
        told = {frozenset(pair) for pair in product(*ends)} & self._apart
        types, affinities = model.geom_contype, model.geom_conaffinity
        meet = [
            bool(types[i] & affinities[k] or types[k] & affinities[i])
            and frozenset((int(model.geom_bodyid[i]), int(model.geom_bodyid[k]))) not in told
            for i, k in product(ours, theirs)
        ]
        if not any(meet) or all(meet):
            return not any(meet)
        through = any(
            self._overlap(i, k)
            for i, k in product(ours, theirs)
            if frozenset((int(model.geom_bodyid[i]), int(model.geom_bodyid[k]))) in told
        )
        kept = f"{meet.count(False)} of {len(meet)} pairs of their shapes do not collide in the file"
        how = "now none does: shapes that it excludes overlap" if through else "now all do"
        names = [listing(sorted(self._links[b] for b in end), 4) for end in ends]
        self._notes.append(ImportNote("dropped", " and ".join(f"'{name}'" for name in names), f"{kept}; {how}"))
        return through

    def _overlap(self, first: int, second: int) -> bool:
        """Whether two shapes overlap at the file's zero."""
        model = self._model
        if self._left == 0 or model.geom_type[first] in _UNMEASURED or model.geom_type[second] in _UNMEASURED:
            return False
        self._left -= 1
        if self._data is None:
            self._data = mujoco.MjData(model)
            mujoco.mj_kinematics(model, self._data)
        return mujoco.mj_geomDistance(model, self._data, first, second, 1.0, None) < 0.0


# ------------------------------------------------------------------ pairs of geoms that a file names


def of_pairs(model: Any) -> list[ImportNote]:
    """What is lost of each `<pair>` of a compiled file: nothing where its geoms would meet so without it."""
    told: dict[str, list[str]] = {}
    for number in range(model.npair):
        first, second = int(model.pair_geom1[number]), int(model.pair_geom2[number])
        geoms = [model.geom(g).name or f"geom{g}" for g in (first, second)]
        who = model.pair(number).name or " and ".join(geoms)
        if _kept_apart(model, first, second):
            told.setdefault("do not meet here, where masks or bodies keep their geoms apart", []).append(who)
        elif other := _differing(model, number, first, second):
            effect = f"meet with what their two geoms have, not with the {', '.join(other)} of the pair"
            told.setdefault(effect, []).append(who)
    return [
        ImportNote("dropped", "pairs", f"{effect} ({len(ones)}: {listing(ones, 3)})") for effect, ones in told.items()
    ]


def _kept_apart(model: Any, first: int, second: int) -> bool:
    """Whether two geoms meet by their pair alone: masks, an exclusion, or one body or neighbours keep them apart."""
    masks = model.geom_contype, model.geom_conaffinity
    if not (masks[0][first] & masks[1][second] or masks[0][second] & masks[1][first]):
        return True
    bodies = sorted(int(model.geom_bodyid[g]) for g in (first, second))
    if (bodies[0] << 16) + bodies[1] in model.exclude_signature:
        return True
    one, other = (int(model.body_weldid[body]) for body in bodies)
    above = [int(model.body_weldid[model.body_parentid[body]]) for body in (one, other)]
    return one == other or (bool(one and other) and (above[0] == other or above[1] == one))


def _differing(model: Any, number: int, first: int, second: int) -> list[str]:
    """The attributes of a pair that are not those which MuJoCo makes of its two geoms."""
    geoms = [first, second]
    priority = model.geom_priority[geoms]
    if priority[0] != priority[1]:
        geoms = [geoms[int(np.argmax(priority))]]
    mix = model.geom_solmix[geoms] / max(1e-12, float(model.geom_solmix[geoms].sum()))
    slide, turn, roll = model.geom_friction[geoms].max(axis=0)
    solref = model.geom_solref[geoms]
    usual = {
        "condim": model.geom_condim[geoms].max(),
        "friction": [slide, slide, turn, roll, roll],
        "solref": mix @ solref if (solref[:, 0] > 0).all() else solref.min(axis=0),
        "solimp": mix @ model.geom_solimp[geoms],
        "margin": model.geom_margin[[first, second]].sum(),
        "gap": model.geom_gap[[first, second]].sum(),
    }
    own = {key: np.asarray(getattr(model, f"pair_{'dim' if key == 'condim' else key}")[number]) for key in usual}
    used = {"friction": {1: 0, 3: 2, 4: 3, 6: 5}[int(own["condim"])]}  # a contact without friction heeds none
    different = []
    for key, value in usual.items():
        gap = np.atleast_1d(np.abs(own[key] - np.asarray(value)))[: used.get(key)]
        if gap.size and gap.max() > 1e-12:
            different.append(key)
    if np.any(model.pair_solreffriction[number]):
        different.append("solreffriction")
    return different
