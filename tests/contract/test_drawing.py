"""Drawing on this machine: decided once, and nothing but a lack of the machine's own is a reason to skip."""

import pytest

from anysim.engine.capability import Capabilities, Capability, Support
from anysim.errors import CannotDraw, EngineError
from anysim.testing.engines import MUST_DRAW, drawing_trouble, require_drawing
from anysim.testing.kinematic import NullEngine


def _drawing(error):
    """An engine that declares pictures and raises this instead, and how often it was asked."""

    class Drawing(NullEngine):
        name = "drawing"
        capabilities = Capabilities({**NullEngine.capabilities.supported, Capability.RENDER_RGB: Support()})
        asked = 0

        def _render(self, view, ids, channels):
            type(self).asked += 1
            if error is not None:
                raise error
            return {"rgb": None}

    return Drawing


def test_a_machine_without_a_driver_is_asked_once_and_skips():
    engine = _drawing(CannotDraw("no driver, here"))
    for _ in range(3):
        with pytest.raises(pytest.skip.Exception, match="drawing cannot draw here: no driver; here"):
            require_drawing(engine)
    assert engine.asked == 1


@pytest.mark.parametrize("error", [EngineError("it cannot draw here"), RuntimeError("torn"), KeyError("sky")])
def test_any_other_error_is_an_error(error):
    with pytest.raises(type(error)):
        require_drawing(_drawing(error))


def test_a_machine_that_must_draw_fails(monkeypatch):
    engine = _drawing(CannotDraw("no driver"))
    for value in ("all", "other,drawing"):
        monkeypatch.setenv(MUST_DRAW, value)
        with pytest.raises(pytest.fail.Exception, match="no driver; ANYSIM_MUST_DRAW says that it can"):
            require_drawing(engine)
    monkeypatch.setenv(MUST_DRAW, "other")
    with pytest.raises(pytest.skip.Exception):
        require_drawing(engine)


def test_an_engine_that_draws_is_asked_no_more():
    engine = _drawing(None)
    require_drawing(engine)
    require_drawing(engine)
    assert drawing_trouble(engine) == ""
    assert engine.asked == 1
