"""A vocabulary of a stranger: found, merged over ours, and refused where two strangers contradict each other."""

import json
from pathlib import Path

import pytest

from anysim_language.vocabulary import VocabularySpec, vocabulary_file
from anysim_schemas.jsonschema import render as schema_of
from tests.external_packages import install, offered, run

SAY = """
import json
from anysim_language.describe import described_task
from anysim_language.instruction import instructions
from anysim_language.episode import begun
said = described_task("pick_cube", seed=1)
print(json.dumps({"scene": said.scene, "from": said.vocabularies, "do": instructions(begun("pick_cube", 1))}))
"""
NAMES = "import json; from anysim import registry; print(json.dumps(registry.names('vocabularies')))"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with anysim-lexicon in it."""
    return install("anysim-lexicon", tmp_path_factory.mktemp("site"))


def test_it_is_found_without_being_imported(site: Path) -> None:
    done = run(site, "-c", NAMES)
    assert json.loads(done.stdout) == ["english", *offered("anysim-lexicon")["vocabularies"]], done.stderr


def test_its_words_win_over_ours(site: Path) -> None:
    done = run(site, "-c", SAY)
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert "kitchen hand" in said["scene"]
    assert "orange stock cube" in said["scene"]
    assert "The stock cube dissolves in hot water." in said["scene"]
    assert said["do"][1] == "Fetch the stock cube and serve it to the goal."
    assert said["from"] == ["anysim-language:english", "anysim-lexicon:kitchen"]


def test_two_strangers_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    site = install("anysim-lexicon", tmp_path)
    other = site / "anysim_other"
    other.mkdir()
    (other / "__init__.py").write_text("")
    (other / "other.yaml").write_text("things:\n  cube: {noun: dice}\n")
    info = site / "anysim_other-0.1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: anysim-other\nVersion: 0.1.0\n")
    (info / "entry_points.txt").write_text("[anysim.vocabularies]\nother = anysim_other\n")
    done = run(site, "-c", SAY)
    assert "the vocabularies 'kitchen' and 'other' have different words for things.cube" in done.stderr
    assert "anysim-lexicon" in done.stderr


def test_a_fault_in_its_file_is_told_with_its_place(tmp_path: Path) -> None:
    site = install("anysim-lexicon", tmp_path)
    file = site / "anysim_lexicon" / "kitchen.yaml"
    file.write_text(file.read_text().replace("noun: whisk,", "nuon: whisk,"))
    done = run(site, "-c", SAY)
    assert "kitchen.yaml:3" in done.stderr
    assert "nuon" in done.stderr


def test_the_schema_for_editors_is_that_of_the_model() -> None:
    written = vocabulary_file("english").with_name("vocabulary.schema.json").read_text()
    assert written == schema_of(VocabularySpec), "write anysim_schemas.jsonschema.render(VocabularySpec) into it"
