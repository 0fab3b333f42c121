"""An audit looks at everything that may be there, and leaves who was there."""

import numpy as np
import pytest

from anysim.testing.audit import audit, world_rows
from anysim.testing.engines import require_engine
from anysim.testing.varying import having, varied


@pytest.mark.parametrize("name", ["null", "mujoco", "pybullet", "sapien"])
def test_what_is_absent_now_is_audited_too(name):
    engine_class = require_engine(name)
    world = varied(engine_class.capabilities)
    with engine_class().create_world(world, 2) as engine:
        engine.reset([0], present=having(world, "mug~1"))
        before = engine.presence
        lines = audit(engine)
        assert np.array_equal(engine.presence, before)
        assert {(row.subject, row.quantity) for row in world_rows(world)} <= {(x.subject, x.quantity) for x in lines}
        assert not [line for line in lines if line.ok is False]
        found = {line.subject for line in lines if line.ok}
        assert {"mug~0", "mug~1", "mug~2", "mug~2.handle", "chest~0.drawer", "chest~1", "lid"} <= found
