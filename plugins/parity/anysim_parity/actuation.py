"""Layer `actuation`: the same tape of joint targets, where nothing can be touched."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.capability import Capability
from anysim.errors import CapabilityError
from anysim.model.world import JointType, World
from anysim_parity.engines import Engines, declared, in_world, moves_by_force, on_each
from anysim_parity.reference import drive_solution, no_reference
from anysim_parity.result import Gap, Layer, Measure, Plot, Series
from anysim_parity.tape import Tape, make_tape
from anysim_parity.variants import mechanisms

TRANSIENT, AT_REST = 5e-3, 1e-3
"""[rad or m] on the way and at the end: engines take the law in steps of 2 ms, each with an error of first order."""

PLOTS = 4
"""Of the joints in which engines differ most."""

_QUESTION = "Do drives follow the same targets in the same way, where nothing is touched and nothing falls?"
_KINDS = {JointType.REVOLUTE: ("turning joints", "rad"), JointType.PRISMATIC: ("sliding joints", "m")}


def actuation_layer(world: World, engines: Engines, *, seed: int = 0) -> Layer:
    """Play the tape of a seed on every engine; compare the joints with each other and with the law's solution."""
    world = mechanisms(world)
    tape = make_tape(world, np.random.default_rng(seed))
    played = on_each(engines, in_world(world, lambda engine: play(engine, tape)))
    why_not = no_reference(world)
    solution = None if why_not else drive_solution(world, tape)
    known = declared({n: engines[n] for n in played.found}, Capability.CONTROL_POSITION, Capability.ARMATURE)
    measures: list[Measure] = []
    gaps: list[Gap] = []
    for kind, (what, unit) in _KINDS.items():
        joints = [i for i, joint in enumerate(world.joints) if joint.type is kind]
        if not joints:
            continue
        for when, rows, tolerance in _spans(tape):
            subject = f"{what}: {when}"
            curves = {name: curve[rows][:, joints] for name, curve in played.found.items()}
            if solution is not None:
                errors = {name: _furthest(curve, solution[rows][:, joints]) for name, curve in curves.items()}
                why = known if max(errors.values(), default=0.0) > tolerance else ""
                measures.append(Measure(f"{subject}, from the law", unit, errors, 0.0, tolerance, why))
            gaps += [
                Gap(subject, unit, a, b, _furthest(curves[a], curves[b]), tolerance, why_not or known)
                for a, b in combinations(curves, 2)
            ]
    plots = tuple(_plot(world, i, played.found, solution) for i in _most_different(played.found, solution))
    return Layer("actuation", _QUESTION, tuple(measures), plots, refused=played.refused, gaps=tuple(gaps))


def play(engine: SimEngine, tape: Tape) -> Array:
    """Joint positions (T, J) after each control step of the tape.

    Raises:
        CapabilityError: the engine moves joints without forces.
    """
    if not moves_by_force(engine):
        raise CapabilityError(f"{engine.name} moves joints without forces, so there is no drive to compare")
    substeps = engine.world.physics.substeps
    rows = []
    for target in tape.targets:
        engine.set_control(position=target)
        engine.step(substeps)
        rows.append(engine.get_state().joint_pos[0])
    return np.array(rows)


def _spans(tape: Tape) -> list[tuple[str, slice, float]]:
    """The moves, and the last fifth of the rest."""
    end = len(tape.targets)
    return [
        ("largest deviation on the way", slice(0, end - tape.rest), TRANSIENT),
        ("largest deviation at rest", slice(end - max(1, tape.rest // 5), end), AT_REST),
    ]


def _furthest(a: Array, b: Array) -> float:
    return float(np.abs(a - b).max(initial=0.0))


def _most_different(curves: Mapping[str, Array], solution: Array | None) -> list[int]:
    everything = [*curves.values(), *([] if solution is None else [solution])]
    if len(everything) < 2:
        return []
    spread = np.ptp(np.stack(everything), axis=0).max(axis=0)
    return np.argsort(-spread, kind="stable")[:PLOTS].tolist()


def _plot(world: World, joint: int, curves: Mapping[str, Array], solution: Array | None) -> Plot:
    """One joint: how far from the law's solution, or from the mean of the engines where it has none."""
    truth = np.mean(list(curves.values()), axis=0) if solution is None else solution
    x = tuple((np.arange(1, len(truth) + 1) * world.physics.control_dt).tolist())
    series = tuple(
        Series(name, x, tuple((1000.0 * (curve[:, joint] - truth[:, joint])).tolist()))
        for name, curve in curves.items()
    )
    unit = "mrad" if world.joints[joint].type is JointType.REVOLUTE else "mm"
    zero = Series("mean of the engines" if solution is None else "the law", (x[0], x[-1]), (0.0, 0.0))
    return Plot(world.joints[joint].name, "time [s]", f"deviation [{unit}]", series, zero)
