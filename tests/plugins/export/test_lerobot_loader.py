"""LeRobot's own loader reads an exported data set, agrees about its statistics, and trains on it.

`make test-lerobot` runs these, in an environment with lerobot; ANYSIM_EXPORT_RUN names a recorded run with two cameras
to take in place of one of fifty episodes.
"""

import importlib.util
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim.record.reader import open_trajectory
from anysim_export.api import Episode
from anysim_export.job import export
from anysim_export.lerobot.video import padded
from anysim_export.streams import channels_of
from tests.plugins.export.runs import committed, import_torchvision, record

pytestmark = [
    pytest.mark.skipif(importlib.util.find_spec("lerobot") is None, reason="needs lerobot: make test-lerobot"),
    pytest.mark.filterwarnings("ignore"),  # those of lerobot and what it imports
]
CAMERAS = ("observation.images.front", "observation.images.wrist")
REWARD = "next.reward"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded run."""
    given = os.environ.get("ANYSIM_EXPORT_RUN")
    return Path(given) if given else record(tmp_path_factory.mktemp("lerobot") / "run", 50)


@pytest.fixture(scope="module")
def loaded(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The data set, exported, and loaded by LeRobot."""
    import_torchvision()
    from lerobot.datasets.lerobot_dataset import LeRobotDataset  # pyright: ignore[reportMissingImports]

    out = tmp_path_factory.mktemp("data") / "lerobot"
    export([run], "lerobot", out)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HF_HUB_OFFLINE", "1")
        patch.setenv("HF_DATASETS_CACHE", str(out.parent / "cache"))
        yield LeRobotDataset("anysim/exported", root=out, video_backend="pyav")


def episodes(run: Path) -> list[Episode]:
    """What was recorded."""
    return [Episode(i, open_trajectory(path)) for i, path in enumerate(committed(run))]


def shown(one: Episode, name: str) -> list[Any]:
    """The images that its video is of: one for each action, with even sides."""
    return [padded(image) for image in one.images(name.rpartition(".")[2])][: one.steps]


def test_it_reads_every_number_and_image(run: Path, loaded: Any) -> None:
    recorded = episodes(run)
    assert (loaded.num_episodes, len(loaded)) == (len(recorded), sum(one.steps for one in recorded))
    first = 0
    worst = 0.0
    for one in recorded[:5]:
        images = {name: shown(one, name) for name in CAMERAS}
        for t in range(0, one.steps, 7):
            frame = loaded[first + t]
            np.testing.assert_array_equal(frame["action"].numpy(), one.actions[t].astype(np.float32))
            np.testing.assert_array_equal(frame["observation.state"].numpy(), one.obs["policy"][t])
            assert frame["task"] == one.tasks[t]
            assert frame["subtask"] == one.segments[t]
            assert (int(frame["episode_index"]), int(frame["frame_index"])) == (one.index, t)
            for name in CAMERAS:
                there = frame[name].numpy().transpose(1, 2, 0) * 255.0
                worst = max(worst, float(np.abs(there - images[name][t]).mean()))
        first += one.steps
    assert worst < 5.0, "images differ by more than a lossy video explains"
    print(
        f"\n{loaded.num_episodes} episodes, {len(loaded)} frames; images differ by up to {worst:.2f} of 255 on average"
    )


def test_depth_and_segmentation_come_out_as_they_were_recorded(
    run: Path, loaded: Any, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Images of one channel: metres in float32, and numbers of entities, whatever the sampler's batches."""
    import torch  # pyright: ignore[reportMissingImports]
    from lerobot.datasets.lerobot_dataset import LeRobotDataset  # pyright: ignore[reportMissingImports]

    out, recorded = tmp_path_factory.mktemp("depth") / "lerobot", episodes(run)[:2]
    export([one.directory for one in recorded], "lerobot", out, {"channels": True, "images": False})
    data = LeRobotDataset("anysim/depth", root=out)
    expected = {
        channel.name: np.stack([image for one in recorded for image in list(one.channel(channel))[:-1]])
        for channel in channels_of(recorded[0].manifest)
    }
    assert set(expected) == {"depth", "segmentation"}
    for batch in torch.utils.data.DataLoader(data, batch_size=16, shuffle=True):
        for name, rows in expected.items():
            there = batch[f"observation.images.front_{name}"].numpy()
            assert there.dtype == (np.float32 if name == "depth" else np.int16)
            np.testing.assert_array_equal(there[:, 0], rows[batch["index"].numpy()])
    for name, rows in expected.items():
        stats = data.meta.stats[f"observation.images.front_{name}"]
        assert stats["max"].shape == (1, 1, 1)
        assert float(stats["max"].item()) == rows.max()


def test_its_statistics_are_the_same(run: Path, loaded: Any) -> None:
    """LeRobot's own functions, given the recorded numbers and images as float64 (see `lerobot/stats.py`)."""
    from lerobot.datasets.compute_stats import (  # pyright: ignore[reportMissingImports]
        aggregate_stats,
        auto_downsample_height_width,
        get_feature_stats,
        sample_indices,
    )

    per_episode: list[dict[str, Any]] = []
    for one in episodes(run):
        rows = {"observation.state": one.obs["policy"][:-1], "action": one.actions, REWARD: one.rewards[:, None]}
        found = {
            name: get_feature_stats(values.astype(np.float32).astype(np.float64), axis=0, keepdims=False)
            for name, values in rows.items()
        }
        for name in CAMERAS:
            images = shown(one, name)
            chosen = [auto_downsample_height_width(images[t].transpose(2, 0, 1)) for t in sample_indices(one.steps)]
            stats = get_feature_stats(np.stack(chosen).astype(np.float64), axis=(0, 2, 3), keepdims=True)
            found[name] = {k: v if k == "count" else np.squeeze(v / 255.0, axis=0) for k, v in stats.items()}
        per_episode.append(found)
    theirs = aggregate_stats(per_episode)
    worst = {name: 0.0 for name in theirs}
    for name, stats in theirs.items():
        assert set(stats) == set(loaded.meta.stats[name])
        for key, values in stats.items():
            ours = np.asarray(loaded.meta.stats[name][key])
            assert ours.shape == values.shape, (name, key)
            worst[name] = max(worst[name], float((np.abs(ours - values) / np.maximum(1.0, np.abs(values))).max()))
    print(f"\nlargest differences of statistics: {worst}")
    assert max(worst.values()) < 1e-6


def test_a_training_step_runs(loaded: Any) -> None:
    """ACT, small: its loss is finite, and less after some steps on the same batch."""
    import torch  # pyright: ignore[reportMissingImports]
    from lerobot.configs.types import FeatureType  # pyright: ignore[reportMissingImports]
    from lerobot.datasets.lerobot_dataset import LeRobotDataset  # pyright: ignore[reportMissingImports]
    from lerobot.datasets.utils import dataset_to_policy_features  # pyright: ignore[reportMissingImports]
    from lerobot.policies.act.configuration_act import ACTConfig  # pyright: ignore[reportMissingImports]
    from lerobot.policies.act.modeling_act import ACTPolicy  # pyright: ignore[reportMissingImports]
    from lerobot.policies.factory import make_pre_post_processors  # pyright: ignore[reportMissingImports]

    features = dataset_to_policy_features(loaded.meta.features)
    outputs = {name: one for name, one in features.items() if one.type is FeatureType.ACTION and name == "action"}
    inputs = {name: one for name, one in features.items() if name.startswith("observation.")}
    config = ACTConfig(
        input_features=inputs,
        output_features=outputs,
        chunk_size=8,
        n_action_steps=8,
        dim_model=32,
        n_heads=2,
        dim_feedforward=64,
        n_encoder_layers=1,
        pretrained_backbone_weights=None,
        device="cpu",
        push_to_hub=False,
    )
    torch.manual_seed(0)
    policy = ACTPolicy(config)
    before, _ = make_pre_post_processors(config, dataset_stats=loaded.meta.stats)
    chunks = LeRobotDataset(
        "anysim/exported",
        root=loaded.root,
        video_backend="pyav",
        delta_timestamps={"action": [t / loaded.fps for t in range(8)]},
    )
    batch = next(iter(torch.utils.data.DataLoader(chunks, batch_size=4, shuffle=True)))
    assert tuple(batch["action"].shape) == (4, 8, len(loaded.meta.features["action"]["names"]))
    optimizer = torch.optim.AdamW(policy.parameters(), lr=1e-3)
    losses: list[float] = []
    for _ in range(8):
        loss, _ = policy.forward(before(dict(batch)))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(loss))
    print(f"\nlosses of ACT: {losses[0]:.3f} -> {losses[-1]:.3f}")
    assert np.isfinite(losses).all()
    assert losses[-1] < losses[0]
