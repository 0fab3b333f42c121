"""Recordings on a page: what is drawn at a row is what was recorded there, on an engine or without one."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import anysim
from anysim.errors import RecordError
from anysim.record.names import trajectories
from anysim.record.reader import open_trajectory
from anysim.skills.runner import SkillPolicy
from anysim_film.stage import FilmOrder
from anysim_recording.collector import Collector
from anysim_viewer.gate import Access
from anysim_viewer.page import Page
from anysim_viewer.playback import Playback
from tests.plugins.viewer.person import Person, looking
from tests.task.helpers import BLIND

SHORT = (*BLIND, "task.horizon=6", "record.keep=all", "record.cameras=[]")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two short episodes of an arm."""
    out = tmp_path_factory.mktemp("run")
    with anysim.make("pick_cube", engine="null", num_envs=2, overrides=SHORT) as env:
        list(Collector(env, SkillPolicy(env), out, 2, 0).run())
    return trajectories(out)


@pytest.fixture(scope="module")
def shown(recorded: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Playback, Page]]:
    page = Page(Access(token="token"), "recording")
    try:
        view = Playback(page, recorded, FilmOrder(), play=False, out=tmp_path_factory.mktemp("videos"))
        yield view, page
        view.close()
    finally:
        page.close()


@pytest.fixture
def person(shown: tuple[Playback, Page]) -> Iterator[Person]:
    view, page = shown
    view.transport.play(False)
    view.begin(0)
    with looking(view, page.url) as one:
        one.until(lambda: any("/bodies/" in name for name in one.nodes))
        yield one


def drawn(person: Person, body: int) -> np.ndarray:
    """Where a body is drawn."""
    node = next(
        one for name, one in person.nodes.items() if name.startswith(f"/bodies/{body}-") and name.count("/") == 2
    )
    return np.array(node.get("position", np.full(3, np.inf)))


def test_rows_are_drawn_as_recorded(shown: tuple[Playback, Page], person: Person, recorded: list[Path]) -> None:
    reader = open_trajectory(recorded[0])
    poses, body = reader.states_from_reset("body_pose"), reader.manifest.layout.bodies.index("panda.panda_link7")
    for row in (4, 1, 6):
        person.choose("row", row)
        person.until(lambda row=row: np.allclose(drawn(person, body), poses[row, body, :3], atol=1e-5))
        person.until(lambda row=row: f"step {row} of 6" in person.words)
    name, value = reader.manifest.layout.action[0], reader.actions[5][0]
    person.until(lambda: f"| {name} | {value:.4f} |" in person.words)
    assert "on null" in person.words


def test_time_goes_on_to_the_end_and_begins_again(shown: tuple[Playback, Page], person: Person) -> None:
    view = shown[0]
    person.press("Play")
    person.until(lambda: view.at == 6 and not view.transport.playing)
    person.press("Step")
    person.until(lambda: view.at == 0)
    person.press("Step")
    person.until(lambda: view.at == 1)


def test_another_episode_is_chosen(shown: tuple[Playback, Page], person: Person, recorded: list[Path]) -> None:
    other = open_trajectory(recorded[1])
    person.choose("episode", recorded[1].name)
    person.until(lambda: f"episode seed {other.manifest.episode_seed}" in person.words)
    goal = shown[0]._staged.env.scene.poses["goal"][0, :3]
    person.until(lambda: np.allclose(person.nodes["/goals/goal"].get("position", np.inf), goal, atol=1e-5))
    person.choose("episode", "../../elsewhere")
    person.until(lambda: any("there is no episode" in words for words in person.told))


def test_what_was_not_recorded_is_grey(person: Person) -> None:
    assert person.elements[person.find("contacts")]["hint"] == "contacts are not recorded"
    assert "record.streams.matter" in person.elements[person.find("matter")]["hint"]


def test_a_recording_that_is_damaged_is_refused(recorded: list[Path], tmp_path: Path) -> None:
    page = Page(Access(token="token"), "damaged")
    try:
        (tmp_path / "manifest.json").write_text("{}")
        with pytest.raises(RecordError):
            Playback(page, [tmp_path], FilmOrder(), play=False, out=tmp_path)
    finally:
        page.close()
