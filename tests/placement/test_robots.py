"""Things are placed around robots where these stand in the episode."""

import numpy as np

import anysim
from anysim.testing.engines import require_engine

RUN = {
    "physics": {"dt": 0.002, "control_dt": 0.02},
    "num_envs": 8,
    "world": {
        "name": "yard",
        "robots": {
            "rover": {
                "robot": "holonomic_base",
                "position": {"range": [[-0.6, -0.6, 0.0], [0.6, 0.6, 0.0]]},
                "yaw": {"range": [-3.0, 3.0]},
            }
        },
        "objects": {"crate": {"source": {"box": [0.3, 0.3, 0.3]}}},
        "layout": {"crate": {"on": "terrain", "region": {"rectangle": [[-0.7, -0.7], [0.7, 0.7]]}}},
        "contact_sensors": {"hit": {"body": "crate", "against": "rover"}},
    },
    "task": {"observations": {"policy": [{"term": "base_pose", "robot": "rover"}]}},
}


def test_nothing_starts_inside_of_a_robot_whose_place_is_drawn() -> None:
    require_engine("mujoco")
    with anysim.make(RUN, engine="mujoco") as env:
        for seed in range(4):
            env.reset(seed=seed)
            env.step(np.zeros((8, env.action_dim)))
            assert not np.linalg.norm(env.engine.get_state().contact_force, axis=-1).any()
