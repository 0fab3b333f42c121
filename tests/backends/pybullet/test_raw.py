"""Bullet's own loop, which the engine is measured against."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from anysim import api
from anysim.engine.control import NUDGE
from anysim.engine.factory import create_simulation
from anysim_bench.step import panda_and_boxes
from anysim_pybullet import raw
from anysim_pybullet.bullet import bullet


def test_the_raw_loop_writes_two_commands_in_turn(monkeypatch: Any) -> None:
    seen: list[Any] = []

    class Told:
        """Bullet, and the motor targets that it was told."""

        def __getattr__(self, name: str) -> Any:
            return getattr(bullet(), name)

        def setJointMotorControlArray(self, *words: Any, **terms: Any) -> None:
            if "targetPositions" in terms:
                seen.append(SimpleNamespace(**terms).targetPositions)
            bullet().setJointMotorControlArray(*words, **terms)

    monkeypatch.setattr(raw, "bullet", Told)
    with create_simulation("pybullet") as engine:
        engine.create_world(api.compile_world(panda_and_boxes()))
        loop, before = engine.raw_loop(), engine.get_state().body_pose
        assert loop is not None
        for _ in range(4):
            loop(1)
        assert np.array_equal(engine.get_state().body_pose, before), "the raw loop moved the engine's own state"
        held = engine.control.position[0]
    assert [targets == seen[0] for targets in seen] == [True, False, True, False]
    assert np.allclose(seen[0], held, rtol=0, atol=1e-12)
    assert np.allclose(seen[1], held + NUDGE, rtol=0, atol=1e-12)
