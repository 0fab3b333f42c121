"""Particles as a category: terms and skills that take many things take them, each in its env."""

import numpy as np
import pytest

import anysim
from anysim.errors import NameLookupError
from anysim.task.slot_frames import CategoryView

RUN = {
    "engine": "mujoco",
    "num_envs": 2,
    "physics": {"dt": 0.004, "control_dt": 0.02},
    "world": {
        "objects": {"post": {"source": {"box": [0.1, 0.1, 0.1]}, "fixed": True}},
        "layout": {"post": {"position": [1.0, 0.0, 0.05]}},
        "families": {
            "water": {
                "kind": "fluid",
                "box": [0.04, 0.04, 0.02],
                "fill": {"range": [0.3, 0.9]},
                "position": [0, 0, 0.5],
            }
        },
    },
    "task": {
        "observations": {
            "policy": [
                {"term": "category_pose", "category": "water"},
                {"term": "category_present", "category": "water"},
            ]
        },
        "success": {
            "here": {
                "term": "count_inside",
                "category": "water",
                "b": "post",
                "low": [-1.1, -0.1, 0.0],
                "high": [-0.9, 0.1, 1.0],
                "count": 17,
            }
        },
    },
}


def test_particles_are_a_category_of_which_each_env_has_its_own_number() -> None:
    with anysim.make(RUN) as env:
        assert env.families is not None
        obs = env.reset(seed=3)[0]["policy"]
        view, water = CategoryView(env.scene, "water"), env.families.family("water")
        state = env.families.state("water")
        there = state.fields["there"]
        assert there.sum(axis=1).tolist() == water.memory["count"].tolist()
        assert len(set(there.sum(axis=1).tolist())) == 2
        assert view.names[:2] == ("water.0", "water.1")
        assert len(view) == 32
        env.scene.look(None)
        assert np.array_equal(view.present, there)
        assert np.array_equal(view.positions[there], state.points[there])
        assert not view.positions[~there].any()
        assert (view.poses[..., 6] == 1.0).all()
        assert obs.shape == (2, 32 * 8)
        assert np.array_equal(obs[:, 32 * 7 :], there.astype(float))
        status = env.step(np.zeros((2, 0))).status
        assert [word == "success" for word in status] == (there.sum(axis=1) >= 17).tolist()
        env.scene.look(np.array([1]))  # the rows at hand alone
        assert view.positions.shape == (1, 32, 3)
        assert np.allclose(view.twists[0, there[1], 2], -9.81 * 0.02, atol=1e-3)
        with pytest.raises(NameLookupError, match="there is no category 'watr'"):
            CategoryView(env.scene, "watr")
