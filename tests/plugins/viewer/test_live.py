"""A live view: what is drawn is where it is, and what people do in the page is done."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import SnapshotError, TaskError
from anysim_viewer.actor import Actor, names_of
from anysim_viewer.gate import Access
from anysim_viewer.live import LiveView
from anysim_viewer.mover import movables, put
from anysim_viewer.page import Page
from tests.plugins.viewer.person import Person, looking
from tests.task.helpers import BLOCKS, arm


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[LiveView, Page]]:
    """Two envs of blocks, and their page."""
    page = Page(Access(token="token"), "blocks")
    try:
        with anysim.make(BLOCKS, num_envs=2) as env:
            view = LiveView(page, env, 3, out=tmp_path_factory.mktemp("videos"))
            yield view, page
            view.close()
    finally:
        page.close()


@pytest.fixture
def person(shown: tuple[LiveView, Page]) -> Iterator[Person]:
    view, page = shown
    view.transport.play(False)
    view.choose_env(0)
    view.reset(3)
    with looking(view, page.url) as one:
        one.until(lambda: any("/bodies/" in name for name in one.nodes))
        yield one


def node(person: Person, part: str) -> dict[str, Any]:
    """The node of a body."""
    return next(one for name, one in person.nodes.items() if name.startswith("/bodies/") and name.endswith(part))


def at(person: Person, part: str, place: Any) -> bool:
    """Whether a body is drawn at a place."""
    return bool(np.allclose(node(person, part).get("position", np.inf), place, atol=1e-5))


def test_bodies_and_goals_are_drawn_where_they_are(shown: tuple[LiveView, Page], person: Person) -> None:
    env, world = shown[0].env, shown[0].env.engine.world
    pose = env.engine.get_state().body_pose[0]
    for name in ("table", "red", "ball"):
        body = env.engine.index.body(name)
        person.until(lambda name=name, body=body: at(person, f"-{world.bodies[body].name}", pose[body, :3]))
    goal = env.scene.poses["goal"][0]
    person.until(lambda: np.allclose(person.nodes["/goals/goal"].get("position", np.inf), goal[:3], atol=1e-5))
    drawn = env.engine.get_parameters("geom.color", [0])[0]
    geom = next(g for g, one in enumerate(world.geoms) if world.bodies[one.body].name == "red")
    meshes = [one for name, one in person.nodes.items() if "-red/" in name]
    assert meshes[0]["color"] == np.rint(255 * drawn[geom, :3]).astype(int).tolist()
    person.until(lambda: "blocks" in person.words and "episode seed" in person.words)


def test_time_goes_on_and_stands_still(shown: tuple[LiveView, Page], person: Person) -> None:
    env = shown[0].env
    person.press("Step")
    person.until(lambda: "step 1 of 8" in person.words)
    assert env.scene.elapsed.tolist() == [1, 1]
    person.press("Play")
    person.until(lambda: env.scene.elapsed[0] > 3)
    person.press("Pause")
    person.until(lambda: not shown[0].transport.playing)
    person.choose("seed", 9)
    person.press("Reset")
    person.until(lambda: "step 0 of 8" in person.words and shown[0].seed == 9)
    with anysim.make(BLOCKS, num_envs=2) as other:
        other.reset(seed=9)
        np.testing.assert_array_equal(other.engine.get_state().body_pose, env.engine.get_state().body_pose)


def test_another_env_is_looked_at(shown: tuple[LiveView, Page], person: Person) -> None:
    person.choose("env", 1)
    body = shown[0].env.engine.index.body("ball")
    there = shown[0].env.engine.get_state().body_pose[1, body, :3]
    person.until(lambda: at(person, "-ball", there))
    person.until(lambda: "env 1 of 2" in person.words)
    person.choose("env", 40)  # a page can say anything
    person.until(lambda: shown[0].i == 1)


def test_objects_are_moved_while_time_stands_still_and_goals_at_any_time(
    shown: tuple[LiveView, Page], person: Person
) -> None:
    view, env = shown[0], shown[0].env
    ball, before = env.engine.index.body("ball"), env.engine.get_state().body_pose.copy()
    person.choose("what", "object ball")
    person.until(lambda: view._mover.chosen is not None)
    person.drag((0.1, 0.2, 0.9))
    person.until(lambda: at(person, "-ball", [0.1, 0.2, 0.9]))
    after = env.engine.get_state().body_pose
    np.testing.assert_allclose(after[0, ball], [0.1, 0.2, 0.9, 0.0, 0.0, 0.0, 1.0])
    np.testing.assert_array_equal(after[1], before[1])
    view.page.ask(lambda: view.transport.play(True))
    person.drag((0.0, 0.0, 2.0))
    person.until(lambda: any("pause to move object ball" in words for words in person.told))
    view.page.ask(lambda: view.transport.play(False))
    person.until(lambda: not view.transport.playing)
    person.choose("what", "goal goal")
    person.until(lambda: view._mover.chosen is not None and view._mover.chosen.goal == "goal")
    person.drag((0.3, 0.0, 0.7))
    person.until(lambda: np.allclose(env.scene.poses["goal"][0, :3], [0.3, 0.0, 0.7]))
    np.testing.assert_allclose(env.obs["policy"][0, -3:], [0.3, 0.0, 0.7], atol=1e-6)  # and is observed there
    person.choose("what", "nothing")


def test_what_the_page_was_not_offered_is_refused(shown: tuple[LiveView, Page], person: Person) -> None:
    person.choose("acts", "os:getcwd")
    person.until(lambda: any("there is no policy 'os:getcwd'" in words for words in person.told))
    assert shown[0]._actor.name == "nothing"


def test_what_an_engine_lacks_is_grey(person: Person) -> None:
    camera = person.elements[person.find("camera")]
    assert camera["disabled"]
    assert "null draws no images" in camera["hint"]
    assert person.elements[person.find("Record")]["disabled"]


def test_goals_and_objects_can_be_moved_to_poses_alone() -> None:
    with anysim.make(BLOCKS) as env:
        env.reset(seed=0)
        things = movables(env)
        assert set(things) == {"goal goal", "object table", "object red", "object ball"}
        with pytest.raises(SnapshotError):
            put(env, 0, things["goal goal"], np.full(7, np.nan))


def test_who_acts_gives_actions_or_is_refused() -> None:
    with arm() as env:
        env.reset(seed=0)
        assert names_of(env, "numpy:zeros")[:1] == ("nothing",)
        assert "numpy:zeros" in names_of(env, "numpy:zeros")
        ids = np.array([0])
        still = Actor(env)
        still.begin(ids)
        np.testing.assert_array_equal(still.act(ids), np.clip(np.zeros((1, env.action_dim)), *env.action_bounds))
        wrong = Actor(env, "tests.plugins.viewer.test_live:three")
        wrong.begin(ids)
        with pytest.raises(TaskError, match="expected actions"):
            wrong.act(ids)
        chunky = Actor(env, "tests.plugins.viewer.test_live:chunk")
        chunky.begin(ids)
        assert [float(chunky.act(ids)[0, 0]) for _ in range(3)] == [0.0, 1.0, 0.0]


def three(obs: dict[str, Any]) -> Any:
    """Not actions."""
    return np.zeros((1, 3, 1, 1))


def chunk(obs: dict[str, Any]) -> Any:
    """Two actions at once, of an arm and its gripper."""
    return np.arange(2.0)[None, :, None] * np.ones((len(obs["policy"]), 1, 8))
