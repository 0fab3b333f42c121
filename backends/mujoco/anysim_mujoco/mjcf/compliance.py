"""Solver settings of an MJCF file, where it sets them, as the neutral model's compliance."""

from typing import Any

import numpy as np

from anysim.model.world import Compliance
from anysim_mujoco.mjcf.surfaces import NATIVE_IMPEDANCE, NATIVE_REFERENCE


def mixed(solref: Any) -> bool:
    """Whether a `solref` (2,) mixes a time constant with a damping, or the reverse: MuJoCo takes its default there."""
    return bool((solref[0] > 0) != (solref[1] > 0))


def softness(solref: Any) -> float:
    """The time constant [s] that a file gives a constraint; 0 where it gives none, or a stiffness."""
    constant = 0.0 if mixed(solref) else float(solref[0])
    return constant if constant > 0 and abs(constant - NATIVE_REFERENCE) > 1e-9 else 0.0


def constraint_compliance(solref: Any, solimp: Any, margin: float = 0.0, unit: float = 1.0) -> Compliance | None:
    """Compliance of a limit, a tie or dry friction; None where the file sets nothing but a time constant.

    `unit` is what lengths along it are scaled with. What is given at all is given whole, as the file has it.
    """
    reference, impedance = _reference(solref), _impedance(solimp, unit)
    if reference is None and impedance is None and margin == 0.0:
        return None
    whole = _width(NATIVE_IMPEDANCE, unit)
    given = (NATIVE_REFERENCE, 1.0) if mixed(solref) else (float(solref[0]), float(solref[1]))
    return Compliance(reference or given, impedance or whole, float(margin) * unit)


def contact_compliance(model: Any, geom: int, scale: float) -> Compliance | None:
    """Compliance of a geom of a compiled model, where its surface does not say it all."""
    impedance = _impedance(model.geom_solimp[geom], scale)
    bent = impedance is not None and impedance[2:] != _width(NATIVE_IMPEDANCE, scale)[2:]
    condim = int(model.geom_condim[geom])
    found = Compliance(
        _reference(model.geom_solref[geom]),
        impedance if bent else None,
        float(model.geom_margin[geom]) * scale,
        float(model.geom_gap[geom]) * scale,
        float(model.geom_solmix[geom]),
        condim if condim in (1, 6) else 0,
    )
    return None if found == Compliance() else found


def _reference(solref: Any) -> tuple[float, float] | None:
    """What a time constant alone does not say."""
    told = not mixed(solref) and (float(solref[0]) <= 0 or float(solref[1]) != 1.0)
    return (float(solref[0]), float(solref[1])) if told else None


def _impedance(solimp: Any, unit: float) -> tuple[float, float, float, float, float] | None:
    return None if np.allclose(solimp, NATIVE_IMPEDANCE, rtol=0, atol=1e-9) else _width(solimp, unit)


def _width(solimp: Any, unit: float) -> tuple[float, float, float, float, float]:
    low, high, width, middle, power = (float(v) for v in solimp)
    return low, high, width * unit, middle, power
