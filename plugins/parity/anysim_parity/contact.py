"""The contact layer: small worlds with known answers, run on every engine."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from anysim.engine.base import SimEngine
from anysim.engine.capability import Capabilities, Capability
from anysim.engine.requirements import needs_of
from anysim.errors import EngineError, listing
from anysim_parity.judge import largest_gap
from anysim_parity.probes.drop import bounce, drop
from anysim_parity.probes.grasp import grasp, lift
from anysim_parity.probes.pairs import pairs
from anysim_parity.probes.probe import Probe, Quantity, Reading, series
from anysim_parity.probes.roll import roll
from anysim_parity.probes.slide import incline, slide
from anysim_parity.probes.stack import stack
from anysim_parity.probes.tilt import slip, topple
from anysim_parity.result import Layer, Measure, Plot

PROBES: Mapping[str, Callable[[float], Probe]] = {
    "drop": drop, "bounce": bounce, "slide": slide, "incline": incline, "pairs": pairs, "roll": roll, "slip": slip,
    "topple": topple, "stack": stack, "grasp": grasp, "lift": lift,
}  # fmt: skip
"""By name what makes a probe for a physics step [s]."""

QUESTION = "Do things fall, lie, bounce, slide, roll, stack and hold as mechanics says?"


def contact_layer(
    engines: Mapping[str, Callable[[], SimEngine]], *, dt: float = 0.002, probes: Sequence[str] | None = None
) -> Layer:
    """Run the probes on every engine.

    Args:
        engines: by name what makes an engine without a world; each is made anew for each probe and destroyed.
        dt: the physics step [s] of the probes' worlds.
        probes: some of `PROBES`, in their order there; all by default.

    An engine that lacks what a probe needs, or fails in it, is left out of that probe; `refused` says why. Without
    contact sensors an engine is still asked for everything but forces.

    Raises:
        EngineError: there is no such probe.
    """
    unknown = [name for name in probes or () if name not in PROBES]
    if unknown:
        raise EngineError(f"there is no probe '{unknown[0]}' (probes: {listing(PROBES, 20)})")
    measures: list[Measure] = []
    plots: list[Plot] = []
    refused: dict[str, list[str]] = {}
    for name in PROBES:
        if probes is not None and name not in probes:
            continue
        probe = PROBES[name](dt)
        found: dict[str, Reading] = {}
        declared: dict[str, Capabilities] = {}
        for engine, make in engines.items():
            try:
                declared[engine], found[engine] = _run(probe, make)
            except Exception as error:  # noqa: BLE001  a stranger's engine may raise anything; the others go on
                refused.setdefault(engine, []).append(f"{name}: {_words(error)}")
            else:
                if missing := _missing(probe, found[engine], declared[engine]):
                    refused.setdefault(engine, []).append(missing)
        measures += [_measure(quantity, found, declared) for quantity in probe.quantities]
        plots += [_plot(plot, found) for plot in probe.plots]
    words = {engine: "; ".join(reasons) for engine, reasons in refused.items()}
    return Layer("contact", QUESTION, tuple(measures), tuple(plots), refused=words)


def _run(probe: Probe, make: Callable[[], SimEngine]) -> tuple[Capabilities, Reading]:
    with make() as engine:
        declared, world = engine.capabilities, probe.world
        if Capability.CONTACT_SENSORS not in declared:
            world = replace(world, contact_sensors=())
        needed = [*probe.needs, *(need.capability for need in needs_of(world))]
        absent = [str(c) for c in dict.fromkeys(needed) if c not in declared]
        if absent:
            raise EngineError(f"{engine.name} does not declare {listing(absent)}")
        engine.create_world(world)
        found = probe.run(engine)
        if engine.get_state().fault.any():
            raise EngineError("its state is no longer finite")
        return declared, found


def _missing(probe: Probe, found: Reading, declared: Capabilities) -> str:
    """What an engine that ran the probe gives no number for, and why."""
    absent = [q.subject for q in probe.quantities if not math.isfinite(found.values.get(q.subject, math.nan))]
    if not absent:
        return ""
    sensors = Capability.CONTACT_SENSORS
    why = "nothing was there to measure" if sensors in declared else f"it does not declare {sensors}"
    return f"{listing(absent)}: {why}"


def _words(error: Exception) -> str:
    return str(error) if isinstance(error, EngineError) else f"{type(error).__name__}: {error}"


def _measure(quantity: Quantity, found: Mapping[str, Reading], declared: Mapping[str, Capabilities]) -> Measure:
    values = {
        engine: one.values[quantity.subject]
        for engine, one in found.items()
        if math.isfinite(one.values.get(quantity.subject, math.nan))
    }
    measure = Measure(quantity.subject, quantity.unit, values, quantity.reference, quantity.tolerance)
    return measure._replace(explanation=explanation(measure, quantity, declared))


def explanation(measure: Measure, quantity: Quantity, declared: Mapping[str, Capabilities]) -> str:
    """What accounts for a difference: what the engines that are off declare, and what is known of the quantity."""
    gap = largest_gap(measure)
    if gap is None or measure.tolerance is None or gap <= measure.tolerance:
        return ""
    words: list[str] = []
    for engine, value in measure.values.items():
        if measure.reference is None or abs(value - measure.reference) > measure.tolerance:
            for capability in quantity.about:
                support = declared[engine].supported.get(capability)
                if support is not None and not support.exact:
                    words.append(f"{engine} declares for {capability}: {support.note}.")
    return " ".join([*words, quantity.remark] if quantity.remark else words)


def _plot(plot: Plot, found: Mapping[str, Reading]) -> Plot:
    drawn = [series(engine, *one.curves[plot.title]) for engine, one in found.items() if plot.title in one.curves]
    return plot._replace(series=tuple(drawn))
