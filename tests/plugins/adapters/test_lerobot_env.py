"""LeRobot makes and evaluates tasks of anysim by its own factory and evaluation.

`make test-lerobot` runs these, in an environment with lerobot.
"""

import importlib.util
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.testing.engines import require_engine
from anysim_adapters.lerobot_env import LeRobotEnv

OVERRIDES = ["record.cameras=[]", "task.horizon=6"]
SEEN = ["task.images={front: {}}", "world.cameras.front.size=[64, 48]"]


def test_an_episode_in_its_words_is_that_of_the_task() -> None:
    require_engine("mujoco")
    view = LeRobotEnv("reach", engine="mujoco", overrides=OVERRIDES)
    with anysim.make("reach", engine="mujoco", num_envs=1, overrides=OVERRIDES) as env:
        obs, _ = view.reset(seed=4)
        env.reset(seed=[4])
        assert list(obs) == ["agent_pos"]
        assert view.observation_space.contains(obs)
        assert view.task_description == env.instruction(0) != ""
        assert view.get_wrapper_attr("_max_episode_steps") == 6
        for _ in range(6):
            obs, reward, terminated, truncated, info = view.step(np.zeros(env.action_dim))
            assert reward == float(env.step(np.zeros((1, env.action_dim))).reward[0])
            assert np.array_equal(obs["agent_pos"], np.nan_to_num(env.obs["policy"][0]))
        assert truncated or terminated
        assert info["is_success"] in (True, False)
    view.close()


@pytest.mark.skipif(importlib.util.find_spec("lerobot") is None, reason="needs lerobot: make test-lerobot")
@pytest.mark.filterwarnings("ignore")  # those of lerobot and what it imports
def test_its_own_evaluation_judges_episodes() -> None:
    from tests.plugins.export.runs import import_torchvision

    import_torchvision()
    import torch  # pyright: ignore[reportMissingImports]
    from lerobot.configs.parser import load_plugin  # pyright: ignore[reportMissingImports]
    from lerobot.envs.configs import EnvConfig  # pyright: ignore[reportMissingImports]
    from lerobot.envs.factory import make_env, make_env_pre_post_processors  # pyright: ignore[reportMissingImports]
    from lerobot.envs.utils import close_envs, env_to_policy_features  # pyright: ignore[reportMissingImports]
    from lerobot.policies.act.configuration_act import ACTConfig  # pyright: ignore[reportMissingImports]
    from lerobot.policies.act.modeling_act import ACTPolicy  # pyright: ignore[reportMissingImports]
    from lerobot.scripts.lerobot_eval import eval_policy_all  # pyright: ignore[reportMissingImports]

    load_plugin("anysim_adapters.lerobot")
    config = EnvConfig.get_choice_class("anysim")(task="reach", engine="mujoco", overrides=[*OVERRIDES, *SEEN])
    features = env_to_policy_features(config)
    assert config.type == "anysim"
    assert config.fps > 0
    assert features["observation.images.front"].shape == (3, 48, 64)
    sizes: list[Any] = []

    class Still(ACTPolicy):
        """ACT's place, without its network: a policy that holds still and notes what it sees."""

        def __init__(self) -> None:
            torch.nn.Module.__init__(self)
            self.config = ACTConfig(device="cpu")

        def reset(self) -> None:
            pass

        def select_action(self, batch: Any, **_: Any) -> Any:
            sizes.append((batch["observation.state"].shape, batch["observation.images.front"].shape, batch["task"]))
            return torch.zeros(2, features["action"].shape[0])

    envs = make_env(config, n_envs=2)
    before, after = make_env_pre_post_processors(config, ACTConfig(device="cpu"))
    found = eval_policy_all(
        envs, Still(), before, after, lambda batch: batch, lambda action: action, n_episodes=2, start_seed=3
    )
    close_envs(envs)
    assert found["overall"]["n_episodes"] == 2
    assert 0.0 <= found["overall"]["pc_success"] <= 100.0
    assert len(sizes) == 6
    state, image, words = sizes[0]
    assert (state[0], image) == (2, (2, 3, 48, 64))
    assert len(words) == 2
    assert all(words)
