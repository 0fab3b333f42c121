"""An annotator of a stranger: found, checked, and written beside trajectories as ours are; and what the suite finds."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from anysim import registry
from anysim_annotation.api import Annotator, Field, Labels
from anysim_annotation.conformance import check_annotator
from tests.external_packages import FOUND, install, offered, run

OURS = ("boxes_2d", "boxes_3d", "camera", "depth", "flow", "instance", "normals", "point_cloud", "semantic")
CHECK = """
import numpy as np
from anysim.engine.factory import create_simulation
from anysim_annotation.capture import Capture
from anysim_annotation.conformance import check_annotator, small_world

check_annotator("stixels")
check_annotator("stixels", {"reach": 1.3})
with create_simulation("null") as engine:
    engine.create_world(small_world())
    labels = Capture(engine, {"eye": {"stixels": {"reach": 3.0}}}, "geometry").take()["eye"]["stixels"]
    [[record]] = labels.records
    nearest = labels.arrays["nearest"][0]
assert record["name"] == "ball" and abs(record["distance"] - (1.4 * 0.957826 + 0.4 * 0.287348 - 0.15)) < 2e-2, record
assert nearest[record["column"]] == nearest.min() == np.float32(record["distance"])
print("labelled")
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with anysim-stixels in it."""
    return install("anysim-stixels", tmp_path_factory.mktemp("site"))


def test_all_that_it_offers_is_found_and_loads(site: Path) -> None:
    done = run(site, "-c", FOUND, "anysim-stixels")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == offered("anysim-stixels")


def test_it_labels_what_it_says_and_keeps_its_promises(site: Path) -> None:
    done = run(site, "-c", CHECK)
    assert done.stdout == "labelled\n", done.stderr[-3000:]


def test_the_command_names_it_and_checks_its_parameters(site: Path, tmp_path: Path) -> None:
    (tmp_path / "episodes" / "env_0000_episode_0000").mkdir(parents=True)
    words = ("-m", "anysim.cli", "render", str(tmp_path), "--annotate")
    done = run(site, *words, "{stixels: {reach: -1}}")
    assert "annotate.stixels.reach: must be greater than 0" in done.stderr


@pytest.mark.parametrize("name", OURS)
def test_ours_keep_the_promises_too(name: str) -> None:
    check_annotator(name)


class Counting(Annotator):
    """Labels that depend on how often it was asked."""

    records: Mapping[str, Field] = {"calls": Field()}
    calls = 0

    def annotate(self, view):
        self.calls += 1
        return Labels({}, [[{"calls": self.calls}] for _ in range(len(view))])


class Undeclared(Counting):
    """A key that it does not declare."""

    def annotate(self, view):
        return Labels({}, [[{"count": 1}] for _ in range(len(view))])


class Misshapen(Annotator):
    """An array of another shape than it says."""

    arrays: Mapping[str, Field] = {"image": Field(("H", "W"), "1", "float32")}

    def annotate(self, view):
        return Labels(
            {"image": [np.zeros((view.scene.width, view.scene.height), np.float32)] * len(view)}, [()] * len(view)
        )


@pytest.mark.parametrize(
    ("wrong", "error", "words"),
    [
        (Counting, AssertionError, "labels the same episode otherwise again"),
        (Undeclared, registry.PluginFailure, r"made a record of \['count'\], and declares \['calls'\]"),
        (Misshapen, registry.PluginFailure, r"made 'image' of shape \(48, 36\) of float32, and declares"),
    ],
)
def test_the_suite_finds_what_is_wrong(wrong, error, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    real = registry.load
    monkeypatch.setattr(registry, "load", lambda kind, name: wrong if kind == "annotators" else real(kind, name))
    with pytest.raises(error, match=words):
        check_annotator("depth")
