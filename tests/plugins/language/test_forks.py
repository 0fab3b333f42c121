"""Forks and reach: asked from one method, found again by another."""

from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anysim.errors import RecordError
from anysim.model.world import World
from anysim_language.check.answers import Checker
from anysim_language.check.reach import reaches
from anysim_language.episode import Episode, begun, recorded
from anysim_language.questions.all import verified
from anysim_language.questions.forks import Fork, forked
from anysim_language.questions.otherwise import about_forks
from anysim_language.questions.past import Past
from anysim_language.questions.question import Asker, Question
from anysim_language.questions.reach import about_reach

IN_HAND = 130
"""A control step of the recording at which the arm holds the cube in the air."""


@pytest.fixture(scope="module")
def stacking(stacked: Path) -> Episode:
    return recorded(stacked)


@pytest.fixture(scope="module")
def forks(stacking: Episode) -> Mapping[int, tuple[Fork, ...]]:
    return forked(stacking, [0, IN_HAND, len(stacking.body_pose) - 1])


def asked(episode: Episode, forks: Mapping[int, tuple[Fork, ...]]) -> Iterator[Question]:
    past = Past(episode, 0, forks)
    for step in forks:
        yield from about_forks(Asker(past, step))


def test_what_would_happen_is_what_physics_says(stacking: Episode, forks: Mapping[int, tuple[Fork, ...]]) -> None:
    found = {
        (q.step, q.program["kind"], q.program["what"], q.program["thing"], sum(map(abs, q.program["wrench"])) > 1.0): (
            q.program["outcome"]
        )
        for q in asked(stacking, forks)
    }
    last = len(stacking.body_pose) - 1
    assert found[IN_HAND, "open", "panda", "cube", False] == "falls"
    assert found[last, "remove", "base", "cube", False] == "falls"
    assert found[last, "remove", "cube", "base", False] == "stays"
    assert found[0, "remove", "table", "cube", False] == "falls"
    assert found[0, "push", "base", "base", False] == "stays"
    assert found[0, "push", "base", "base", True] in ("moves", "falls")
    assert (IN_HAND, "remove", "cube", "cube", False) not in found


def test_every_outcome_is_found_again_from_the_recorded_state(
    stacking: Episode, forks: Mapping[int, tuple[Fork, ...]]
) -> None:
    questions = list(asked(stacking, forks))
    assert len(questions) > 20
    others = stacking.vocabulary.words.outcomes
    with closing(Checker(stacking)) as checker:
        for question in questions:
            assert checker.verify(question), question
            for outcome, words in others.items():
                if outcome != question.program["outcome"]:
                    assert not checker.verify(question._replace(answer=words))
                    lied = {**question.program, "outcome": outcome}
                    assert not checker.verify(question._replace(answer=words, program=lied))


def test_the_engine_goes_on_from_its_snapshot_as_if_nothing_had_been_asked(
    stacking: Episode, forks: Mapping[int, tuple[Fork, ...]]
) -> None:
    """Of forks at three moments: at the later two the replay was still that of the recording, else it were refused."""
    assert all(len(found) > 5 for found in forks.values())
    again = forked(stacking, [IN_HAND])
    for one, other in zip(forks[IN_HAND], again[IN_HAND], strict=True):
        assert one.change == other.change
        assert np.array_equal(one.body_pose, other.body_pose)


def test_a_recording_that_does_not_replay_is_not_asked_about(stacking: Episode) -> None:
    poses = stacking.body_pose.copy()
    poses[3, :, 0] += 1e-3
    with pytest.raises(RecordError, match=r"at step 3 something is 0\.001 m from where it was"):
        forked(replace(stacking, body_pose=poses), [0, 3])


def test_a_sentence_does_not_say_its_thing_twice(stacking: Episode, forks: Mapping[int, tuple[Fork, ...]]) -> None:
    texts = {q.text for q in asked(stacking, forks)}
    phrase = "the orange cube"
    assert all(text.lower().count(phrase) < 2 for text in texts)
    assert any("if it were" in text or "pushed it" in text for text in texts)


def placed(episode: Episode, thing: str, at: tuple[float, float, float]) -> Episode:
    """The episode with a thing elsewhere."""
    world: World = episode.world
    poses = episode.body_pose.copy()
    poses[0, world.entities[world.entity_numbers[thing]].root, :3] = at
    return replace(episode, body_pose=poses)


@pytest.mark.parametrize(
    ("at", "answer"),
    [((0.5, 0.0, 0.5), "yes"), ((-0.4, 0.3, 0.4), "yes"), ((1.2, 0.0, 0.5), "no"), ((0.0, 0.9, 1.2), "no")],
)
def test_reach_is_that_of_the_arm(at: tuple[float, float, float], answer: str) -> None:
    """A Panda reaches 0.855 m from its shoulder, a third of a metre up, and its tool a little further."""
    episode = placed(begun("pick_cube", 1), "cube", at)
    (question,) = (q for q in about_reach(Asker(Past(episode, 0), 0)) if q.program["thing"] == "cube")
    assert question.answer == answer
    checker = Checker(episode)
    assert checker.verify(question)
    assert not checker.verify(question._replace(answer="no" if answer == "yes" else "yes"))


def test_what_is_at_the_edge_of_reach_is_not_asked() -> None:
    episode = begun("pick_cube", 1)
    robot = episode.world.robots[0]
    line = np.linspace(0.8, 1.1, 31)
    reached = [reaches(episode, 0, robot, np.array([x, 0.0, 0.333])) for x in line]
    edge = float(line[reached.index(False)])
    for x in (edge - 0.02, edge + 0.02):
        moved = placed(episode, "cube", (x, 0.0, 0.333))
        assert not [q for q in about_reach(Asker(Past(moved, 0), 0)) if q.program["thing"] == "cube"]


def test_no_fork_no_question(stacking: Episode) -> None:
    families = {one.question.family for one in verified(stacking, [IN_HAND])}
    assert "counterfactual" not in families
    assert "reachability" in families
