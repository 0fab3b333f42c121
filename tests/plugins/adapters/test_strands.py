"""The backends of strands-robots under its own factory, policy runner and benchmarks.

`make test-strands` runs these, in an environment with strands-robots.
"""

import importlib.util
import inspect
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = [
    pytest.mark.skipif(
        importlib.util.find_spec("strands_robots") is None, reason="needs strands-robots: make test-strands"
    ),
    pytest.mark.filterwarnings("ignore"),  # those of strands-robots and what it imports
]
ENGINES = ("mujoco", "pybullet", "sapien")
ARM = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="base">
      <inertial mass="1" pos="0 0 0" diaginertia="0.01 0.01 0.01"/>
      <body name="upper" pos="0 0 0.3">
        <joint name="lift" axis="0 1 0" range="-2 2"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03" mass="1"/>
        <body name="lower" pos="0 0 0.3">
          <joint name="reach" axis="0 1 0" range="-2 2"/>
          <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.02" mass="0.5"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="lift" joint="lift" kp="200" kv="20"/>
    <position name="reach" joint="reach" kp="200" kv="20"/>
  </actuator>
  <keyframe><key name="low" qpos="0.5 -0.25"/><key name="ready" qpos="0.2 0.4"/></keyframe>
</mujoco>
"""


def data(answer: dict[str, Any]) -> dict[str, Any]:
    assert answer["status"] == "success", answer["content"][0]["text"]
    return next((block["json"] for block in answer["content"] if "json" in block), {})


def refusal(answer: dict[str, Any]) -> str:
    assert answer["status"] == "error", answer
    return answer["content"][0]["text"]


@pytest.fixture(params=ENGINES)
def sim(request: pytest.FixtureRequest) -> Iterator[Any]:
    from strands_robots.simulation import create_simulation  # pyright: ignore[reportMissingImports]

    made = create_simulation(f"anysim_{request.param}")
    data(made.create_world(timestep=0.004))
    yield made
    made.cleanup()


@pytest.fixture
def arm(sim: Any) -> Any:
    data(sim.add_robot("arm", data_config="panda"))
    data(sim.add_object("cube", "box", position=[0.5, 0.0, 0.1], size=[0.04, 0.04, 0.04], color=[1, 0, 0, 1]))
    return sim


def test_its_factory_finds_the_backends_and_the_contract_is_kept() -> None:
    from strands_robots.simulation import list_backends  # pyright: ignore[reportMissingImports]
    from strands_robots.simulation.base import SimEngine  # pyright: ignore[reportMissingImports]

    from anysim_adapters.strands.engine import AnysimSimulation

    assert {f"anysim_{engine}" for engine in ENGINES} <= set(list_backends())
    assert len(SimEngine.__abstractmethods__) == 14
    assert not AnysimSimulation.__abstractmethods__
    optional = ["load_scene", "get_contacts", "get_frame", "get_camera_params", "physics_timestep", "robot_action_keys"]
    for name in [*SimEngine.__abstractmethods__, *optional]:
        theirs, ours = (inspect.signature(getattr(cls, name)).parameters for cls in (SimEngine, AnysimSimulation))
        assert [(p.name, p.kind, p.default) for p in ours.values()] == [
            (p.name, p.kind, p.default) for p in theirs.values()
        ], name


def test_its_policy_runner_moves_the_arm(arm: Any) -> None:
    before = arm.get_observation("arm", skip_images=True)
    keys = arm.robot_action_keys("arm")
    assert keys == [key for key in before if not key.endswith(".vel")]
    ran = arm.run_policy(robot_name="arm", policy_provider="mock", n_steps=10, control_frequency=25.0)
    assert data(ran)
    after = arm.get_observation("arm", skip_images=True)
    assert max(abs(after[key] - before[key]) for key in keys) > 0.01
    assert arm.physics_timestep() == 0.004
    assert data(arm.get_state())["sim_time"] == pytest.approx(10 / 25.0)


def test_its_benchmarks_judge_episodes(arm: Any, tmp_path: Path) -> None:
    spec = {
        "name": "settles",
        "max_steps": 40,
        "default_robot": "panda",
        "success": {
            "all": [
                {"predicate": "body_below_z", "body": "cube", "z": 0.03},
                {"predicate": "contact_between", "geom_a": "cube", "geom_b": "ground"},
            ]
        },
        "dense_reward": [{"predicate": "distance_neg", "body_a": "arm/panda_hand", "body_b": "cube"}],
    }
    file = tmp_path / "settles.json"
    file.write_text(json.dumps(spec))
    data(arm.register_benchmark_from_file(f"settles_{arm.ENGINE}", str(file)))
    found = data(
        arm.evaluate_benchmark(f"settles_{arm.ENGINE}", robot_name="arm", n_episodes=2, seed=0, control_frequency=25.0)
    )
    assert found["n_episodes"] == 2
    assert found["success_rate"] == 1.0
    assert all(0 < episode["steps"] < 40 for episode in found["episodes"])


def test_pixels_become_points_of_the_world(sim: Any) -> None:
    data(sim.add_object("slab", "box", position=[0.3, -0.2, 0.05], size=[0.4, 0.4, 0.1], is_static=True))
    data(sim.add_camera("above", [0.3, -0.2, 1.0], [0.31, -0.2, 0.0], fov=50, width=64, height=48))
    found = data(sim.get_world_point("above", [[31, 23], [32, 24], [30, 25]]))
    assert np.allclose(found["point"], [0.3, -0.2, 0.1], atol=0.02)
    assert found["point"][2] == pytest.approx(0.1, abs=2e-3)
    rgb, depth = sim.get_frame("above")
    assert rgb.shape == (48, 64, 3)
    assert depth.shape == (48, 64)
    with pytest.raises(KeyError, match="there is no camera 'below'"):
        sim.get_camera_params("below")
    image = sim.render("above")["content"][-1]["image"]
    assert image["source"]["bytes"].startswith(b"\x89PNG")


def test_a_robot_of_a_file_stands_turned_in_its_keyframe(sim: Any, tmp_path: Path) -> None:
    file = tmp_path / "two_links.xml"
    file.write_text(ARM)
    turn = [0.5, 0.5, 0.5, 0.5]
    data(sim.add_robot("bot", urdf_path=str(file), position=[0, 0, 1], orientation=turn, keyframe="ready"))
    for _ in range(2):
        seen = sim.get_observation("bot")
        assert (seen["lift"], seen["reach"]) == pytest.approx((0.2, 0.4), abs=1e-6)
        data(sim.send_action([0.0, 0.0], n_substeps=20))
        data(sim.reset())
    base = data(sim.get_body_state("bot"))
    assert base["quaternion"] == pytest.approx(turn)
    assert base["position"] == pytest.approx([0, 0, 1], abs=1e-6)
    again = sim.add_robot("two", urdf_path=str(file), keyframe="high")
    assert "there is no keyframe 'high' (keyframes: low, ready)" in refusal(again)
    assert sim.list_robots() == ["bot"]


def test_what_is_wrong_is_said_and_changes_nothing(arm: Any) -> None:
    before = arm.get_observation("arm", skip_images=True)
    steps = data(arm.get_state())["sim_time"]
    unresolved = arm.send_action({"panda_joint1": 0.3, "elbow": 1.0}, robot_name="arm")
    assert "has no driven joint elbow" in refusal(unresolved)
    assert unresolved["content"][1]["json"] == {"unresolved_keys": ["elbow"], "applied": {}}
    assert "length 2 does not match" in refusal(arm.send_action([0.0, 1.0], robot_name="arm"))
    assert refusal(arm.send_action({"panda_joint1": float("nan")}))
    assert "n_substeps" in refusal(arm.send_action({"panda_joint1": 0.1}, n_substeps=0))
    assert "mass is a finite number" in refusal(arm.add_object("ball", "sphere", size=[0.1], mass=-1.0))
    assert "is taken" in refusal(arm.add_object("cube"))
    assert "has no robot 'franka_pand'; did you mean" in refusal(arm.add_robot("second", data_config="franka_pand"))
    assert "nothing to randomize called colour" in refusal(arm.randomize(colour=True))
    assert "terrain" in refusal(arm.create_world(terrain="stairs"))
    assert arm.get_observation("arm", skip_images=True) == before
    assert data(arm.get_state())["sim_time"] == steps
    assert arm.get_observation("leg") == {}


def test_seeded_draws_and_scenes(arm: Any) -> None:
    places = []
    for seed in (5, 6, 5):
        data(arm.reset())
        assert data(arm.randomize(randomize_positions=True, randomize_physics=True, seed=seed))["randomized"]
        places.append(data(arm.get_body_state("cube"))["position"] + [data(arm.get_body_state("cube"))["mass"]])
    assert places[0] == places[2] != places[1]
    data(arm.move_object("cube", [0.4, 0.1, 0.3], [0, 1, 0, 0]))
    assert data(arm.get_body_state("cube"))["position"] == pytest.approx([0.4, 0.1, 0.3])
    data(arm.load_scene("reach"))
    assert len(arm.list_robots()) == 1
    data(arm.step(3))
    data(arm.destroy())
    assert "there is no world" in refusal(arm.step())
