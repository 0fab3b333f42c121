"""Words beside assets, and names that stay with a logical object whatever asset it has."""

from pathlib import Path

import pytest
import trimesh

from anysim import registry
from anysim.api import blind_env, compile_world, load, make, watched
from anysim.errors import SpecError
from anysim_language import beside
from anysim_language.beside import robot_words, thing_words
from anysim_language.episode import begun, begun_many
from anysim_language.refer import references
from anysim_language.scene_text import scene_text
from anysim_language.things import things_of
from anysim_language.vocabulary import vocabulary

WORLD = """
world:
  name: kitchen
  robots: {panda: {robot: franka_panda}}
  objects:
    table: {source: {box: [0.8, 1.2, 0.04]}, fixed: true}
    it: {source: {mesh: assets/gourd.obj}, count: 2}
  layout:
    table: {position: [0.5, 0.0, 0.38]}
    it: {on: table}
"""
WORDS = Path(__file__).with_name("words.yaml")
"""The example of the page on language."""


@pytest.fixture
def kitchen(tmp_path: Path) -> Path:
    """A world with a mesh that has words beside it."""
    beside._vocabulary.cache_clear()
    (tmp_path / "assets").mkdir()
    trimesh.creation.icosphere(1, 0.04).export(tmp_path / "assets" / "gourd.obj")
    (tmp_path / "assets" / "words.yaml").write_text(WORDS.read_text())
    (tmp_path / "kitchen.yaml").write_text(WORLD)
    return tmp_path / "kitchen.yaml"


def test_an_asset_brings_its_words(kitchen: Path) -> None:
    episode = begun(kitchen, 1)
    thing = episode.first.by_name["it_0"]
    assert (thing.words.noun, thing.words.several, thing.material) == ("bottle gourd", "bottle gourds", "dried")
    assert {r.phrase.partition(" that is ")[0] for n, r in references(episode.first).items() if n[:2] == "it"} == {
        "bottle gourd"
    }
    assert "can be drunk from." in scene_text(episode)


def test_a_label_and_an_installed_vocabulary_win_over_it(kitchen: Path) -> None:
    named = begun(kitchen, 1, ["world.objects.it.label=lamp"]).first.by_name["it_0"]
    assert named.words.noun == "lamp"
    words = vocabulary().words
    others = words.model_copy(update={"things": {**words.things, "assets/gourd.obj": words.things["jar"]}})
    loaded = watched(load(kitchen))
    with blind_env(loaded, compile_world(loaded), "kitchen") as env:
        env.reset(seed=0)
        things = things_of(env.engine, others, folder=lambda category: kitchen.parent)
    assert {thing.words.noun for thing in things if thing.name.startswith("it")} == {"jar"}


def test_a_fault_in_it_is_told_with_its_place(kitchen: Path) -> None:
    (kitchen.parent / "assets" / "words.yaml").write_text("things:\n  gourd: {nuon: gourd}\n")
    with pytest.raises(SpecError, match=r"words\.yaml:2.*nuon"):
        begun(kitchen, 1)


def test_builders_and_robots_have_theirs_beside_them() -> None:
    mug, panda = thing_words("procedural:mug", None), robot_words("franka_panda")
    assert mug is not None
    assert panda is not None
    assert (mug.noun, mug.container, panda.noun) == ("mug", True, "Panda arm")
    assert thing_words("", None) is None
    assert robot_words("file.urdf") is None


def test_every_robot_and_builder_of_ours_has_words() -> None:
    robots = [name for name in registry.names("robots") if registry.entry("robots", name).value == "anysim_robots"]
    assert len(robots) > 50
    assert [name for name in robots if robot_words(name) is None] == []
    bases = {"ackermann_base", "camera_body", "differential_base", "holonomic_base", "parallel_gripper"}  # of robots
    things = set(registry.names("assets")) - bases
    assert [name for name in sorted(things) if thing_words(f"procedural:{name}", None) is None] == []


VARIED = [
    "world.objects.cube.source={choice: [{box: [0.05, 0.05, 0.05]}, {sphere: 0.03}, {procedural: mug}]}",
    "world.objects.cube.label=thing",
    "record.cameras=[]",
]


def test_a_logical_object_has_one_name_in_words_and_segmentation_whatever_it_is_made_of() -> None:
    """A ray from above meets an id that stands for the name, in every env and after every reset."""
    seen: dict[int, str] = {}
    with make("pick_cube", engine="mujoco", num_envs=4, overrides=VARIED) as env:
        index = env.engine.index
        ids = index.segmentation_ids("cube")
        for seed in range(3):
            env.reset(seed=seed)
            poses = env.engine.get_state().body_pose
            for k in range(4):
                (thing,) = (t for t in things_of(env.engine, vocabulary().words, k) if t.name == "cube")
                above = poses[k, env.engine.world.entities[thing.entity].root, :3] + [0.0, 0.0, 0.3]
                hit = int(env.engine.raycast(above[None, None], [[[0.0, 0.0, -1.0]]], [k]).entity[0, 0])
                assert hit == thing.entity + 1
                assert hit in ids
                assert seen.setdefault(hit, thing.words.noun) == thing.words.noun
    assert sorted(seen.values()) == ["ball", "cube", "mug"]
    assert set(seen) == set(ids)


def test_questions_name_it_so_as_well() -> None:
    nouns = {e.first.by_name["cube"].words.noun for e in begun_many("pick_cube", range(8), VARIED)}
    assert nouns == {"ball", "cube", "mug"}
