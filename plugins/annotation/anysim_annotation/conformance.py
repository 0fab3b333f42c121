"""Promises of an annotator, checked in a small world of moving boxes.

    from anysim_annotation.conformance import check_annotator

    def test_promises():
        check_annotator("stixels")

What it labels is for its own tests to say; here it is whether that depends on what it may depend on.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.factory import create_simulation
from anysim.math import pose as P
from anysim.model.world import Box, Camera, Sphere, World
from anysim.testing.sketch import Sketch
from anysim_annotation.api import Labels
from anysim_annotation.capture import Capture, Moment
from anysim_annotation.files import json_line
from anysim_annotation.view import NOTHING

ENVS, STEPS = 3, 4


def small_world() -> World:
    """A box, a ball and the ground before the camera `eye`, which gives no colours."""
    s = Sketch("small")
    s.ground()
    s.free("crate", Box((0.2, 0.3, 0.1)), (2.0, 0.2, 0.5))
    s.free("ball", Sphere(0.15), (1.4, -0.2, 0.6))
    eye = np.array([0.0, 0.0, 1.0])
    turn = P.look_at(eye, np.array([2.0, 0.0, 0.4]))
    s.cameras.append(Camera("eye", -1, (0.0, 0.0, 1.0), tuple(turn.tolist()), 60.0, 48, 36, channels=()))
    return s.world()


def check_annotator(name: str, params: Mapping[str, Any] = NOTHING, *, world: World | None = None) -> None:
    """Check an annotator of frames, of the camera `eye` of a world, by rays.

    Raises:
        AssertionError: a promise that it does not keep, in a sentence.
        PluginFailure: it makes what it does not declare.
    """
    model = small_world() if world is None else world
    with create_simulation("null") as many, create_simulation("null") as one:
        many.create_world(model, ENVS)
        one.create_world(model, 1)
        before = many.get_state().body_pose.tobytes()
        capture = Capture(many, {"eye": {name: params}}, "geometry")
        for key, field in {**capture.annotators("eye")[name].records, **_arrays(capture, name)}.items():
            assert field.unit, f"'{key}' of '{name}' has no unit; one of pure numbers has '1'"
        first = _episode(capture, many)
        capture.begin()
        _same(first, _episode(capture, many), name, "it labels the same episode otherwise again; forget in `reset`")
        alone = _episode(Capture(one, {"eye": {name: params}}, "geometry"), one)
        _same([labels[:1] for labels in first], alone, name, "env 0 is labelled otherwise when it is alone")
        capture.begin()
        partial = _episode(capture, many, at=2)
        _same(
            [labels[:1] for labels in first],
            [labels[:1] for labels in partial],
            name,
            "a reset of others changes env 0",
        )
        assert many.get_state().body_pose.tobytes() == before, f"'{name}' moves what it looks at"


def _arrays(capture: Capture, name: str) -> Mapping[str, Any]:
    return getattr(capture.annotators("eye")[name], "arrays", NOTHING)


def _episode(capture: Capture, engine: SimEngine, at: int = -1) -> list[list[str]]:
    """What is said of each env at each step, as text; before the step `at` the envs after the first are reset."""
    start, seen = engine.get_state().body_pose, list[list[str]]()
    ids = np.arange(engine.num_envs)
    for step in range(STEPS):
        if step == at:
            capture.begin(ids[1:])
        poses = start.copy()
        poses[:, 1:, 1] += 0.05 * step * (1 + ids[:, None])
        moment = Moment(ids, np.full(len(ids), step), poses)
        [labels] = capture.take(moment)["eye"].values()
        seen.append([_text(labels, row) for row in range(len(ids))])
    return seen


def _text(labels: Labels, row: int) -> str:
    def digest(array: Array) -> object:
        return [str(array.dtype), list(array.shape), np.ascontiguousarray(array).tobytes().hex()]

    arrays = {key: digest(rows[row]) for key, rows in labels.arrays.items()}
    return str(arrays) + "".join(json_line(record) for record in labels.records[row])


def _same(expected: Sequence[Sequence[str]], found: Sequence[Sequence[str]], name: str, words: str) -> None:
    for step, (one, two) in enumerate(zip(expected, found, strict=True)):
        assert one == two, f"'{name}', step {step}: {words}"
