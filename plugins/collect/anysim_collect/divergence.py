"""Divergence of the two members of a pair: from which control step on their states differ."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.record.reader import TrajectoryReader, open_trajectory

FIELDS = ("joint_pos", "joint_vel", "body_pose", "body_twist")
"""The motion; commands are causes of it."""


def pair_entry(episode: int, first: Path, second: Path, tolerance: float) -> dict[str, Any]:
    """What `pairs.json` says of a pair of committed trajectories.

    `diverges` is the first control step, 0 being the reset, at which a number of the motion (in m, rad, m/s, rad/s)
    differs by more than the tolerance, `differs` that at which any bit does; None where they never do. `acts_apart` is
    the first at which the actions differ.
    """
    same, changed = open_trajectory(first), open_trajectory(second)
    gaps = {name: _gaps(same, changed, name) for name in FIELDS}
    worst = _worst(gaps)
    steps = min(len(same.actions), len(changed.actions))
    apart = (same.actions[:steps] != changed.actions[:steps]).any(axis=1)
    manifests = (same.manifest, changed.manifest)
    return {
        "episode": episode,
        "episode_seed": same.manifest.episode_seed,
        "same": first.name,
        "changed": second.name,
        "values": [dict(manifest.overridden) for manifest in manifests],
        "status": [manifest.status for manifest in manifests],
        "steps": [manifest.steps for manifest in manifests],
        "diverges": _first(worst > tolerance),
        "differs": _first(worst > 0.0),
        "acts_apart": None if not apart.any() else 1 + int(np.argmax(apart)),
        "largest": {name: float(gap.max()) for name, gap in gaps.items()},
    }


def gap_of(first: Path, second: Path) -> Array:
    """(F,) the largest difference of the motion of two trajectories at each control step that both have."""
    same, changed = open_trajectory(first), open_trajectory(second)
    return _worst({name: _gaps(same, changed, name) for name in FIELDS})


def _worst(gaps: Mapping[str, Array]) -> Array:
    return np.max([gap for gap in gaps.values()], axis=0)


def _gaps(a: TrajectoryReader, b: TrajectoryReader, name: str) -> Array:
    """(F,) the largest absolute difference of an array at each control step that both have, step 0 first."""
    first, second = (reader.states_from_reset(name) for reader in (a, b))
    count = min(len(first), len(second))
    first, second = first[:count], second[:count]
    if name == "body_pose":  # q and -q are one rotation
        sign = np.where((first[..., 3:] * second[..., 3:]).sum(axis=-1, keepdims=True) < 0, -1.0, 1.0)
        second = np.concatenate([second[..., :3], second[..., 3:] * sign], axis=-1)
    return np.abs(first - second).reshape(count, -1).max(axis=1, initial=0.0)


def _first(differing: Array) -> int | None:
    return int(np.argmax(differing)) if differing.any() else None
