"""Descriptions: phrases that fit one thing alone, the same words in every process, and what happened when."""

import hashlib
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anysim import registry
from anysim.errors import PluginError
from anysim_language.changes import changes
from anysim_language.check.resolve import resolve
from anysim_language.check.scene import RawScene, colour_of
from anysim_language.colours import bytes_of, colour_name, is_clear
from anysim_language.describe import describe, described_task
from anysim_language.episode import Episode, begun, begun_many
from anysim_language.instruction import instructions
from anysim_language.narration import narration
from anysim_language.refer import references
from anysim_language.scene_text import scene_text
from anysim_language.sentences import article, listed, render
from anysim_language.vocabulary import vocabulary

CLUTTER = Path(__file__).with_name("clutter.yaml")
FEW = ("stack_pyramid", "tidy_bin", "handover", "pour_beads", "loco_room_nav")


def ambiguous(episode: Episode) -> list[str]:
    """The references of an episode's first moment that, read back from raw numbers, do not fit their thing alone."""
    scene, viewer = RawScene(episode.world, episode.body_pose[0]), episode.viewer
    origin, forward = np.array(viewer.position) / 1000.0, np.array([*viewer.forward, 0]) / 1000.0
    moment = episode.first
    return [
        f"{episode.name}: '{reference.phrase}' is {name}"
        for name, reference in references(moment).items()
        if resolve(reference.phrase, moment.things, scene, origin, forward) != [name]
    ]


@pytest.mark.parametrize("task", FEW)
def test_no_reference_of_a_task_is_ambiguous(task: str) -> None:
    assert [fault for episode in begun_many(task, [0, 1]) for fault in ambiguous(episode)] == []


@pytest.mark.parametrize(
    "seeds", [pytest.param([2], marks=pytest.mark.slow), pytest.param([0, 1, 2], marks=pytest.mark.full)]
)
def test_no_reference_of_any_task_is_ambiguous(seeds: list[int]) -> None:
    ours = [name for name in registry.names("tasks") if registry.entry("tasks", name).value.startswith("anysim_tasks.")]
    assert [fault for task in ours for episode in begun_many(task, seeds) for fault in ambiguous(episode)] == []


def test_no_reference_in_clutter_is_ambiguous() -> None:
    episodes = list(begun_many(CLUTTER, range(30)))
    assert [fault for episode in episodes for fault in ambiguous(episode)] == []
    phrases = [r.phrase for episode in episodes for r in references(episode.first).values()]
    assert {"larger", "on", "first"} <= {word for phrase in phrases for word in phrase.split()}, "it is not that easy"


def test_a_wrong_reference_is_found() -> None:
    episode = begun("stack_pyramid", 1)
    scene, viewer = RawScene(episode.world, episode.body_pose[0]), episode.viewer
    origin, forward = np.array(viewer.position) / 1000.0, np.array([*viewer.forward, 0]) / 1000.0
    things = episode.first.things
    assert set(resolve("cube", things, scene, origin, forward)) == {"base", "beside", "top"}
    assert resolve("blue cube", things, scene, origin, forward) == []
    assert (
        len({resolve(f"cube that is {n} from the left", things, scene, origin, forward)[0] for n in ("first", "third")})
        == 2
    )


def test_every_object_of_a_task_has_words() -> None:
    said = described_task("put_away", seed=3)
    assert "cabinet" in said.scene
    assert "table" in said.scene
    assert said.vocabularies == ("anysim-language:english",)
    assert said.narration == ()


def test_the_instruction_has_several_phrasings_and_names_what_was_drawn() -> None:
    episode = begun("stack_cube", 1)
    options = instructions(episode)
    assert options[0] == episode.instruction
    assert len(set(options)) == 4
    phrase = references(episode.first)["cube"].phrase
    assert options[1] == f"Put the {phrase} onto the {references(episode.first)['base'].phrase}."
    assert len({describe("x", episode, seed).instruction for seed in range(20)}) == 4


@pytest.mark.slow
def test_every_task_and_every_skill_of_ours_has_words() -> None:
    """Two instructions at least, each a sentence, and none that brings a thing to itself; no skill without words."""
    words = vocabulary().words
    assert [n for n in registry.names("skills") if n not in words.skills] == []
    ours = [name for name in registry.names("tasks") if registry.entry("tasks", name).value.startswith("anysim_tasks.")]
    assert set(words.tasks) <= set(ours)
    for task in ours:
        episode = begun(task, 1)
        options = instructions(episode)
        assert len(set(options)) >= 2, task
        for text in options:
            assert text[0].isupper(), text
            assert text.endswith("."), text
            assert not re.search(r"None|\b(\w+) \1\b|  |\.\.", text), text
            assert not re.search(r"(?:push|move|bring|go) (?:the (.+) )?to the \1\b", text.lower()[:-1] + " "), text


def test_clauses_of_several_commands_make_sentences() -> None:
    episode = begun("put_away", 1)
    assert instructions(episode)[2] == (
        "First pull the top drawer of the cabinet open. Then pick up the cube and place it into the top drawer of the "
        "cabinet. Finally shut the top drawer of the cabinet."
    )
    assert "wo Panda arms " in scene_text(begun("handover", 1), 0)


def test_a_part_that_stands_open_is_told() -> None:
    assert "The top drawer of the cabinet is open." in " ".join(
        scene_text(begun("close_drawer", 1), seed) for seed in range(4)
    )
    assert "drawer of the cabinet is open" not in " ".join(scene_text(begun("put_away", 1), seed) for seed in range(4))


def carried(task: str = "stack_cube") -> Episode:
    """An episode in which the tool takes the cube, sets it on the other one and leaves."""
    episode = begun(task, 1)
    world = episode.world
    cube, base = (world.entities[world.entity_numbers[name]].root for name in ("cube", "base"))
    hand = world.sites[world.robots[0].tools["tool"]].body
    start, goal = episode.body_pose[0, cube].copy(), episode.body_pose[0, base].copy()
    goal[2] += 0.04
    goal[3:] = start[3:]
    above, over = start.copy(), goal.copy()
    above[2] += 0.15
    over[2] += 0.11
    legs = [(start, start, 30), (start, above, 50), (above, over, 60), (over, goal, 40), (goal, goal, 40)]
    path = np.concatenate([a + np.linspace(0, 1, n)[:, None] * (b - a) for a, b, n in legs])
    poses = np.repeat(episode.body_pose, len(path), axis=0)
    poses[:, cube] = path
    site = world.sites[world.robots[0].tools["tool"]]
    poses[:, hand, :3] = path[:, :3] - np.array(site.position)
    poses[:, hand, 3:] = [0.0, 0.0, 0.0, 1.0]
    poses[-20:, hand, 2] += np.linspace(0.0, 0.3, 20)
    joints = np.repeat(episode.joint_pos, len(path), axis=0)
    said = [
        {"skill": "pick_place", "phase": "grasp: approach" if k < 15 else "place: lower"} for k in range(len(path) - 1)
    ]
    return replace(episode, body_pose=poses, joint_pos=joints, annotations=tuple(said), status="success")


def test_change_points_are_found_in_states() -> None:
    found = [(c.kind, c.what, c.where) for c in changes(carried())]
    assert [kind for kind, *_ in found] == ["grasped", "lifted", "placed", "released"]
    assert found[0] == ("grasped", "cube", "panda")
    assert found[1] == ("lifted", "cube", "table")
    assert found[2] == ("placed", "cube", "base")
    steps = [c.step for c in changes(carried())]
    assert 30 < steps[0] < 45
    assert 30 < steps[1] < 45
    assert 175 < steps[2] < 200
    assert 199 < steps[3] < 205


def test_a_narration_has_one_sentence_for_each_change() -> None:
    said = narration(carried(), seed=0)
    assert [s.kind for s in said] == ["began", "phase", "grasped", "lifted", "placed", "released", "success"]
    assert said[0].text == "The Panda arm picks up the orange cube to put it onto the dark gray cube."
    assert "the dark gray cube" in said[4].text
    assert len({narration(carried(), seed=k)[4].text for k in range(8)}) == 2


def test_a_joint_that_opens_and_closes_is_told() -> None:
    episode = begun("put_away", 1)
    world = episode.world
    j = next(k for k, joint in enumerate(world.joints) if world.bodies[joint.body].name == "cabinet.drawer_1")
    opening = np.concatenate([np.linspace(0.0, 1.0, 20), np.linspace(1.0, 0.0, 20)]) * world.joints[j].upper
    joints = np.repeat(episode.joint_pos, 40, axis=0)
    joints[:, j] = opening
    episode = replace(episode, joint_pos=joints, body_pose=np.repeat(episode.body_pose, 40, axis=0))
    assert [(c.kind, c.what) for c in changes(episode)] == [
        ("opened", "cabinet.drawer_1"),
        ("closed", "cabinet.drawer_1"),
    ]
    assert narration(episode)[0].text == "The top drawer of the cabinet is open."


def test_colours_have_the_names_of_an_independent_reading() -> None:
    """Wherever a colour is clear enough to be asked for."""
    generator = np.random.default_rng(0)
    clear = 0
    for color in generator.integers(0, 256, (3000, 3)).tolist():
        value = (color[0], color[1], color[2])
        if is_clear(value):
            clear += 1
            assert colour_of(*(x / 255.0 for x in value)) == colour_name(value)
    assert clear > 600
    assert colour_name(bytes_of((1.0, 0.65, 0.0))) == "orange"
    assert colour_name(bytes_of((0.72, 0.62, 0.5))) == "beige"


def test_small_words_are_right() -> None:
    phrases = (
        "apple",
        "red apple",
        "orange",
        "umbrella",
        "Unitree dog",
        "xArm7",
        "UR5 arm",
        "unit",
        "one",
        "hour glass",
    )
    assert [article(p) for p in phrases[:9]] == ["an", "a", "an", "an", "a", "an", "a", "a", "a"]
    assert listed(["a", "b", "c"]) == "a, b and c"
    assert listed(["a"]) == "a"


def test_a_template_with_a_name_that_is_not_there_is_refused() -> None:
    with pytest.raises(PluginError, match="'colur' is undefined"):
        render("{{ colur }}", {"colour": "red"})
    assert render("{% if goal %}x{% endif %}y", {}, optional=True) == "y"


def test_the_vocabulary_is_whole() -> None:
    words = vocabulary().words
    for skill in words.skills.values():
        assert len(set(skill.do)) == len(skill.do)
    for section in (words.scene, words.events):
        assert all(section.values())


SCENES = ((CLUTTER, 250), ("stack_cube", 25), ("put_away", 25))


@pytest.mark.slow
def test_no_reference_in_300_scenes_is_ambiguous() -> None:
    """Those of which the words are digested below."""
    faults, scenes, phrases = list[str](), 0, 0
    for source, number in SCENES:
        for episode in begun_many(source, range(number)):
            faults += ambiguous(episode)
            scenes, phrases = scenes + 1, phrases + len(episode.things)
    assert faults == []
    assert scenes == 300
    assert phrases > 2000


DIGEST = """
import hashlib, sys
from anysim_language.episode import begun_many
from anysim_language.describe import describe
digest = hashlib.sha256()
count = 0
for source, number in {scenes}:
    for seed, episode in enumerate(begun_many(source, range(number))):
        said = describe(source, episode, seed)
        digest.update(f"{{said.scene}}|{{said.instruction}}\\n".encode())
        count += 1
print(count, digest.hexdigest())
"""


@pytest.mark.parametrize(
    "share", [pytest.param(5, marks=pytest.mark.slow), pytest.param(1, marks=pytest.mark.full)], ids=["fifth", "all"]
)
def test_the_words_of_300_scenes_are_equal_under_three_hash_seeds(share: int) -> None:
    said = [
        subprocess.run(
            [sys.executable, "-c", DIGEST.format(scenes=[(str(source), number // share) for source, number in SCENES])],
            capture_output=True,
            text=True,
            timeout=300,
            env={**os.environ, "PYTHONHASHSEED": seed},
            check=True,
        ).stdout
        for seed in ("0", "1", "2")
    ]
    assert said[0].startswith(f"{300 // share} ")
    assert len(set(said)) == 1


def test_the_words_of_a_scene_are_those_of_every_machine() -> None:
    """Whole numbers decide: what a scene is called may not follow from a library's last bit."""
    texts = [scene_text(episode, seed) for seed, episode in enumerate(begun_many(CLUTTER, range(12)))]
    assert (
        hashlib.sha256("\n".join(texts).encode()).hexdigest()
        == "e891bd46c7b58e196ad723e020280f6080b171a14bad1a996a216d53ca8c7adb"
    )


def test_what_is_carried_along_in_something_is_not_held_itself() -> None:
    """The cube on the other one, which the tool takes: the tool holds that alone."""
    episode = carried()
    world = episode.world
    cube, base = (world.entities[world.entity_numbers[name]].root for name in ("cube", "base"))
    poses = episode.body_pose.copy()
    poses[:, base] = poses[:, cube]
    poses[:, base, 2] -= 0.002
    poses[:, cube, 2] += 0.04
    held = [(c.kind, c.what) for c in changes(replace(episode, body_pose=poses)) if c.kind in ("grasped", "moved")]
    assert held == [("grasped", "base")]


def test_who_takes_a_thing_over_is_told() -> None:
    episode = begun("handover", 1)
    phases = ("grasp: descend", "hold out: carry", "take: descend")
    said = [{"skill": "handover", "phase": phase} for phase in phases for _ in range(6)]
    poses, joints = (np.repeat(rows, 19, axis=0) for rows in (episode.body_pose, episode.joint_pos))
    episode = replace(episode, body_pose=poses, joint_pos=joints, annotations=tuple(said))
    told = narration(episode)
    assert [sentence.who for sentence in told] == ["panda", "panda", "partner"]
    assert "at the back comes down to the bar" in told[-1].text


@pytest.mark.parametrize(
    ("task", "part", "kinds"),
    [
        ("press_button", "button.cap", ["pressed"]),
        ("screw_cap", "jar.cap", ["turned"]),
        ("put_away", "cabinet.drawer_1", ["opened", "closed"]),
        ("push_cart", "cart.body", []),
    ],
)
def test_what_is_done_to_a_part_follows_from_what_its_asset_offers(task: str, part: str, kinds: list[str]) -> None:
    episode = begun(task, 1)
    world = episode.world
    j = next(k for k, joint in enumerate(world.joints) if world.bodies[joint.body].name == part)
    share = np.concatenate([np.linspace(0.0, 1.0, 20), np.linspace(1.0, 0.0, 20)])
    joints = np.repeat(episode.joint_pos, 40, axis=0)
    joints[:, j] = world.joints[j].lower + share * (world.joints[j].upper - world.joints[j].lower)
    episode = replace(episode, joint_pos=joints, body_pose=np.repeat(episode.body_pose, 40, axis=0))
    assert [change.kind for change in changes(episode)] == kinds
    assert all("None" not in sentence.text for sentence in narration(episode))
