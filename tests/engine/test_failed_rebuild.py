"""Live editing whose build fails: the old world is built again and goes on."""

import numpy as np
import pytest

from anysim.engine.factory import create_simulation
from anysim.errors import EngineError
from anysim.testing.engines import require_engine
from anysim.testing.worlds import scene


@pytest.mark.parametrize("name", ["null", "mujoco", "pybullet", "sapien"])
def test_a_rebuild_that_fails_leaves_the_old_world(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    require_engine(name)
    with create_simulation(name) as engine:
        engine.create_world(scene(), 2)
        engine.step(5)
        before, build, calls = engine.get_state().body_pose, engine._build, []

        def failing(world, num_envs):
            calls.append(world)
            if len(calls) == 1:
                raise EngineError("no more room")
            build(world, num_envs)

        monkeypatch.setattr(engine, "_build", failing)
        with pytest.raises(EngineError, match="no more room"):
            engine.add_object("extra", {"sphere": 0.03}, mass=0.1, position=(0.5, 0.0, 0.5))
        assert np.allclose(engine.get_state().body_pose, before, atol=1e-6)
        engine.step(5)
        assert len(calls) == 2
