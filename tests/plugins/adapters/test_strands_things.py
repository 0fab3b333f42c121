"""Objects and robots of strands-robots in the words of a world, without strands-robots."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim.errors import AnysimError, EngineError, PluginError
from anysim.testing.engines import require_engine
from anysim_adapters.strands.answers import answering, error, success
from anysim_adapters.strands.things import keyframe_fields, object_fields, place, robot_model
from anysim_adapters.strands.world import WorldView
from anysim_mujoco.mjcf.keyframes import keyframes
from tests.plugins.adapters.test_strands import ARM


def made(shape: str, size: Any = None, **more: Any) -> dict[str, Any]:
    given = {"color": None, "mass": 0.1, "is_static": None, "mesh_path": None, "material": None} | more
    return object_fields(shape, size, **given)


def test_sizes_are_full_extents() -> None:
    assert made("box", [0.1, 0.2, 0.3])["source"] == {"box": [0.1, 0.2, 0.3]}
    assert made("sphere", [0.1])["source"] == {"sphere": 0.05}
    assert made("cylinder", [0.1, 9, 0.4])["source"] == {"cylinder": [0.05, 0.4]}
    assert made("capsule", [0.1, 9, 0.4])["source"] == {"capsule": [0.05, 0.4]}
    assert made("box", is_static=True, color=[1, 0, 0, 1]) == {
        "source": {"box": [0.05, 0.05, 0.05]},
        "fixed": True,
        "mass": 0.1,
        "color": [1, 0, 0],
    }


@pytest.mark.parametrize(
    ("shape", "more", "message"),
    [
        ("elipsoid", {}, "cannot be made .*shapes: box"),
        ("box", {"size": [0.1]}, "size of a box is 3 to 3 lengths"),
        ("sphere", {"size": [0.0]}, "greater than 0"),
        ("box", {"mass": float("nan")}, "mass"),
        ("box", {"color": [1, 0, 0, 0.5]}, "nothing is transparent"),
        ("box", {"color": [2, 0, 0]}, r"in \[0, 1\]"),
        ("box", {"is_static": "false"}, "is_static is true, false"),
        ("mesh", {}, "needs mesh_path"),
        ("box", {"mesh_path": "a.stl"}, "goes with shape 'mesh'"),
        ("box", {"material": {"shine": 1}}, "material cannot be given"),
    ],
)
def test_what_cannot_be_held_is_refused(shape: str, more: dict[str, Any], message: str) -> None:
    with pytest.raises(EngineError, match=message):
        made(shape, **more)


def test_places_and_robots(tmp_path: Path) -> None:
    assert place([1, 2, 3], [2, 0, 0, 0]) == {"position": [1, 2, 3], "quaternion": [0, 0, 0, 1]}
    with pytest.raises(EngineError, match="not zero"):
        place(None, [0, 0, 0, 0])
    assert robot_model("arm", None, "panda") == "franka_panda"
    assert robot_model("so101", None, None) == "so101"
    with pytest.raises(PluginError, match="no robot 'arm'"):
        robot_model("arm", None, None)
    file = tmp_path / "bot.xml"
    file.write_text(ARM)
    assert keyframes(file) == {"low": {"lift": 0.5, "reach": -0.25}, "ready": {"lift": 0.2, "reach": 0.4}}
    assert keyframe_fields(1, str(file)) == {"home": {"lift": 0.2, "reach": 0.4}}
    assert keyframe_fields("home", None) == keyframe_fields(None, str(file)) == {}
    with pytest.raises(EngineError, match=r"no keyframe 'rest' \(keyframes: home\)"):
        keyframe_fields("rest", None)


def test_answers_never_raise() -> None:
    @answering
    def fails() -> dict[str, Any]:
        raise AnysimError("no floor")

    assert fails() == error("fails: no floor")
    assert success("done", {"a": 1})["content"] == [{"text": "done"}, {"json": {"a": 1}}]


def test_the_view_of_a_world() -> None:
    require_engine("mujoco")
    view = WorldView("mujoco", {"world": {"objects": {"cube": {"source": {"box": [0.1, 0.1, 0.1]}}}}})
    try:
        view.engine.add_robot("arm", "franka_panda", position=[1, 0, 0])
        assert list(view.drives("arm")) == list(view.joints("arm"))
        view.place("cube", [0.3, 0.0, 0.2], None)
        assert view.body_state("cube")["position"] == [0.3, 0.0, 0.2]
        hand, tool = view.body_state("panda_hand"), view.body_state("arm/panda_link7")
        assert hand["body"] == tool["body"] == "arm/panda_link7"
        assert hand["position"] != tool["position"]
        view.command("arm", {"panda_joint1": 0.25})
        held = view.engine.control.position[0]
        assert held[view.drives("arm")["panda_joint1"]] == 0.25
        assert np.count_nonzero(held == 0.25) == 1
        view.place("cube", [0.3, 0.0, 0.05], None)
        view.engine.step(5)
        assert {(c["geom1"], c["geom2"]) for c in view.contacts() if c["active"]} == {("ground", "cube")}
        for wrong in ("terrain", "ground", "panda_hnd"):
            with pytest.raises(AnysimError, match="there is no body"):
                view.body_state(wrong)
    finally:
        view.engine.destroy()
