"""The env of a service against the local one: the same methods, and the same bits."""

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import anysim
from anysim.errors import PluginError, SnapshotError, TaskError
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from anysim_client.env import STAYS
from anysim_client.messages import step_chunk
from anysim_learning.gymnasium import GymEnv, GymVectorEnv
from anysim_serving.server import Service
from tests.plugins.serving.helpers import BLIND, BLOCKS, SEEN, connected, local, same, service


@pytest.fixture(scope="module")
def served() -> Iterator[Service]:
    with service(BLOCKS, "pick_cube", engine="null", overrides=()) as made:
        yield made


@pytest.fixture(scope="module")
def arms() -> Iterator[Service]:
    with service("pick_cube", engine="null", overrides=[*BLIND, "task.horizon=9"]) as made:
        yield made


def local_arm(num_envs: int) -> TaskEnv:
    return local("pick_cube", engine="null", num_envs=num_envs, overrides=[*BLIND, "task.horizon=9"])


def test_it_has_what_a_local_env_has(served: Service) -> None:
    """A method that TaskEnv gains must be there too, or be said to stay with the service."""
    with connected(served) as far, local() as near:
        names = {name for name in {*dir(TaskEnv), *vars(near)} if not name.startswith("_")}
        assert names - STAYS <= set(dir(far)) | {"spec"}
        assert not STAYS & set(dir(far))
        for name in ("name", "num_envs", "action_dim", "observation_sizes", "image_shapes", "spec"):
            assert getattr(far, name) == getattr(near, name), name
        assert same(far.action_bounds, near.action_bounds)
        assert far.engine.world.hash == near.engine.world.hash
        with pytest.raises(AttributeError, match="stays with the service"):
            far.mdp.reward  # noqa: B018


def test_channels_are_those_of_the_env(arms: Service) -> None:
    with connected(arms) as far, local_arm(1) as near:
        assert list(far.action_spaces) == list(near.action_spaces)
        for name, space in near.action_spaces.items():
            assert same(tuple(far.action_spaces[name]), tuple(space))


def test_results_are_the_same_bits(arms: Service) -> None:
    """Resets, masks, named actions, ends, overrides, snapshots and chunks, in one run of both."""
    rng = np.random.default_rng(0)
    with connected(arms, num_envs=3) as far, local_arm(3) as near:
        assert same(far.reset(seed=7), near.reset(seed=7))
        for t in range(5):
            action: Any = rng.uniform(-1, 1, (3, 8)).astype(np.float32)
            if t == 1:
                action = {"panda.arm": action[:, :7], "panda.eef": action[:, 7:]}
            mask = np.array([True, False, True]) if t == 2 else None
            assert same(tuple(far.step(action, mask)), tuple(near.step(action, mask)))
            assert same(far.obs, near.obs)
        for name in ("status", "info", "running"):
            assert same(getattr(far, name), getattr(near, name))
        mask = np.array([False, True, False])
        override = {"layout.cube.x": 0.4}
        assert same(far.reset(mask=mask, overrides=override), near.reset(mask=mask, overrides=override))
        assert same(far.reset(mask=~mask, seed=[3, 4]), near.reset(mask=~mask, seed=[3, 4]))
        assert same(far.reset(mask=np.zeros(3, bool)), near.reset(mask=np.zeros(3, bool)))
        assert same(far.obs, near.obs)
        kept, own = far.snapshot(), near.snapshot()
        assert same(dict(kept.engine.data), dict(own.engine.data))
        assert same(kept.managers, {k: dict(v) for k, v in own.managers.items()})
        assert kept.streams == own.streams
        chunk = rng.uniform(-1, 1, (3, 12, 8))
        theirs, ours = far.step_chunk(chunk), step_chunk(near, chunk)
        assert same(tuple(theirs), tuple(ours))
        assert (theirs.steps <= 9).all()
        assert (theirs.status[:, -1] == "truncated").all()
        assert same(far.reset_to(own, [2, 0, 1]), near.reset_to(kept, [2, 0, 1]))
        assert same(far.obs, near.obs)
        assert far.instruction(1) == near.instruction(1)
        assert same(far.streams.episode_seed, near.streams.episode_seed)


def test_refusals_are_those_of_the_env(served: Service) -> None:
    with connected(served, num_envs=2) as far, local(num_envs=2) as near:
        for env in (far, near):
            with pytest.raises(TaskError, match=r"not reset yet.*call reset"):
                env.step(np.zeros((2, 0)))
            env.reset(seed=0)
            with pytest.raises(TaskError, match="mask must be a bool array"):
                env.reset(mask=np.zeros(3, bool))
            with pytest.raises(TaskError, match="cannot be overridden"):
                env.reset(overrides={"nothing": 1})
            with pytest.raises(TaskError, match="shape"):
                env.step(np.zeros((2, 3)))
            with pytest.raises(SnapshotError, match="takes what snapshot"):
                env.reset_to("file")
        assert same(far.obs, near.obs)  # what failed has changed nothing
        assert same(tuple(far.step(np.zeros((2, 0)))), tuple(near.step(np.zeros((2, 0)))))
        with pytest.raises(Exception, match="no place in a message"):
            far.step(np.array([object()]))


def test_a_snapshot_of_another_task_is_refused(served: Service, arms: Service) -> None:
    with connected(served) as blocks, connected(arms) as arm:
        blocks.reset(seed=0)
        arm.reset(seed=0)
        with pytest.raises(SnapshotError, match=r"nothing was changed|world"):
            arm.reset_to(blocks.snapshot())


def test_results_stay_as_they_are(served: Service) -> None:
    """No caller gets a buffer that changes later, or that changes the env."""
    with connected(served, num_envs=2) as far:
        far.reset(seed=1)
        first = far.step(np.zeros((2, 0)))
        kept = first.obs["policy"].copy()
        far.step(np.zeros((2, 0)))
        assert same(first.obs["policy"], kept)
        seen = far.obs["policy"]
        seen[:] = 0
        assert far.obs["policy"].any()


def test_what_is_known_of_an_episode(served: Service) -> None:
    with connected(served, num_envs=2, full=True) as far, local(num_envs=2) as near:
        far.reset(seed=1)
        near.reset(seed=1)
        told = far.details()[1]
        assert told["draws"] == near.streams.draws[1]
        assert same(told["goals"]["goal"], near.scene.goals["goal"][1])
        assert set(told["poses"]) == {"table", "red", "ball"}
        assert far.latest == []
        far.step(np.zeros((2, 0)))
        assert far.latest[0]["status"] == "running"


# ------------------------------------------------------------------ views


def quiet() -> None:
    warnings.filterwarnings("ignore", message=".*Box.*(infinity|unbounded).*")
    warnings.filterwarnings("ignore", message=".*render_mode.*|.*render modes.*|.*No render.*|.*spec.*")


def test_gymnasiums_checker_passes(arms: Service) -> None:
    with connected(arms, num_envs=1) as far, warnings.catch_warnings():
        quiet()
        check_env(GymEnv(far), skip_render_check=True)  # type: ignore[arg-type]


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_the_vector_view_is_that_of_a_local_env(served: Service, mode: AutoresetMode) -> None:
    far = GymVectorEnv(connected(served, num_envs=2), mode)  # type: ignore[arg-type]
    near = GymVectorEnv(local(num_envs=2), mode)
    try:
        a, b = far.reset(seed=5), near.reset(seed=5)
        assert same(_plain(a), _plain(b))
        for _ in range(12):
            if mode is AutoresetMode.DISABLED and not far.env.running.all():
                done = ~far.env.running
                a, b = (one.reset(options={"reset_mask": done}) for one in (far, near))
                assert same(_plain(a), _plain(b))
            action = np.zeros((2, 0), np.float32)
            assert same(_plain(far.step(action)), _plain(near.step(action)))
    finally:
        far.close()
        near.close()


def _plain(value: Any) -> Any:
    """Arrays of objects as tuples."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        return tuple(_plain(item) for item in value)
    return value


# ------------------------------------------------------------------ images


def test_images_come_by_each_way() -> None:
    """Raw and shared are the same bits as local ones; JPEG is close; nothing is left in the memory's folder."""
    require_engine("mujoco")
    with service(SEEN) as made, local(SEEN, num_envs=2) as near:
        ways = {images: connected(made, num_envs=2, images=images) for images in ("raw", "shared", "jpeg")}
        wanted = near.reset(seed=2)[0]
        colour = next(name for name in wanted if wanted[name].dtype == np.uint8)
        assert wanted[colour].std() > 1
        mask = np.array([False, True])
        steps = [near.step(np.zeros((2, 0))) for _ in range(2)]
        part = near.reset(mask=mask)
        after = near.obs
        for images, far in ways.items():
            assert far.shares_memory == (images == "shared")
            first = far.reset(seed=2)[0]
            done = [far.step(np.zeros((2, 0))) for _ in range(2)]
            again = far.reset(mask=mask)
            if images == "jpeg":
                assert np.abs(first[colour].astype(int) - wanted[colour]).mean() < 8
                assert same(first["policy"], wanted["policy"])
                assert np.abs(far.render().astype(int) - near.render()).mean() < 8
            else:
                assert same(first, wanted)
                assert all(same(tuple(a), tuple(b)) for a, b in zip(done, steps, strict=True))
                assert same(again, part)
                assert same(far.obs, after)
                assert same(far.render(env_ids=[1], size=(20, 16)), near.render(env_ids=[1], size=(20, 16)))
            far.close()
        from anysim_client.shared import shared_folder

        assert not list(shared_folder().glob("anysim-*"))


def test_a_scheme_without_a_client_is_told() -> None:
    with pytest.raises(PluginError, match="client named 'ftp'"):
        anysim.connect("ftp://127.0.0.1:1")
    with pytest.raises(TaskError, match="has an address such as"):
        anysim.connect("127.0.0.1:8470")
