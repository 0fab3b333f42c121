"""The report: verdicts, plain data, and a page that is whole, self-contained and the same every time."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree

from anysim.errors import AnysimError
from anysim.math.statistics import wilson
from anysim_parity.html import page
from anysim_parity.judge import nearest
from anysim_parity.report import Comparison, as_data
from anysim_parity.result import Gap, Layer, Measure, Picture, Plot, Series
from anysim_parity.verdict import ANALYTIC, declares, disagreements, findings
from anysim_parity.write import write


def comparison() -> Comparison:
    bounce = Measure("bounce: <apex> & more", "m", {"a": 0.25, "b": 0.31}, 0.25, 0.02, "b declares: within 0.1")
    drop = Measure("drop: time", "s", {"a": 0.4515, "b": 0.4519}, 0.4515, 0.002)
    curve = Series("a", (0.0, 0.1, 0.2), (0.0, 1.0, float("nan")))
    plot = Plot("height", "time [s]", "height [m]", (curve, curve._replace(name="b")), curve._replace(name="exact"))
    contact = Layer("contact", "Do things bounce?", (bounce, drop), (plot, plot._replace(title="again")))
    success = Measure(
        "success", "", {"a": 1.0, "b": 0.75}, None, 0.0, intervals={"a": wilson(16, 16), "b": wilson(12, 16)}
    )
    pixels = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
    task = Layer(
        "task",
        "Is it solved?",
        (success,),
        pictures=(Picture("front", "a", pixels),),
        refused={"c": "cannot <draw>"},
        gaps=(Gap("only one solves", "", "a", "b", 0.25),),
    )
    return Comparison("pick", {"a": "1.0", "b": "2.0"}, 3, 16, "0123456789abcdef", "2 bodies", (contact, task))


def parsed(text: str) -> Any:
    """The page as XML, which is stricter than HTML."""
    return etree.fromstring(text.replace("<!DOCTYPE html>\n", "").encode())


def test_findings_hold_engines_against_the_answer_and_each_other() -> None:
    contact, task = comparison().layers
    told = {(f.subject, f.first, f.second): f.agree for f in findings(contact)}
    assert told["bounce: <apex> & more", "a", ANALYTIC]
    assert not told["bounce: <apex> & more", "b", ANALYTIC]
    assert not told["bounce: <apex> & more", "a", "b"]
    assert told["drop: time", "a", "b"]
    assert [f.agree for f in findings(task)] == [True], "the intervals of 16 and 12 of 16 overlap"
    beyond = disagreements(comparison().layers)
    assert [(f.first, f.second) for f in beyond] == [("b", ANALYTIC), ("a", "b")]
    assert nearest(contact.measures[0]) == ("a",)
    assert nearest(contact.measures[1]) == ("a",)


def test_intervals_that_do_not_meet_are_a_difference() -> None:
    measure = Measure("success", "", {"a": 1.0, "b": 0.0}, None, 0.0, intervals={"a": (0.8, 1.0), "b": (0.0, 0.2)})
    assert [f.agree for f in findings(Layer("task", "", (measure,)))] == [False]


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [(10, 10, 0.7225, 1.0), (0, 10, 0.0, 0.2775), (8, 10, 0.4902, 0.9433), (0, 0, 0.0, 1.0), (50, 100, 0.4038, 0.5962)],
)
def test_wilson_intervals_are_those_of_the_tables(successes: int, trials: int, low: float, high: float) -> None:
    assert wilson(successes, trials) == pytest.approx((low, high), abs=1e-4)


def test_the_page_is_well_formed_and_asks_for_nothing() -> None:
    text = page(comparison())
    tree = parsed(text)
    assert "http" not in text
    assert not tree.xpath("//script | //link | //iframe")
    for element in tree.iter():
        for name in ("src", "href"):
            value = element.get(name, "#")
            assert value.startswith(("data:", "#")), value
    assert len(tree.xpath("//*[local-name()='svg']")) == 3
    assert all(svg.get("aria-label") for svg in tree.xpath("//*[local-name()='svg']"))
    assert all(image.get("alt") for image in tree.xpath("//img"))
    ids = [element.get("id") for element in tree.iter() if element.get("id")]
    assert len(ids) == len(set(ids))
    targets = {element.get("href")[1:] for element in tree.iter() if (element.get("href") or "").startswith("#")}
    assert targets <= set(ids)


def test_the_page_says_what_differs_and_why() -> None:
    text = page(comparison())
    words = " ".join(parsed(text).itertext())
    assert "bounce: <apex> & more" in words
    assert "b declares: within 0.1" in words
    assert "2 of 6 differ, as declared" in words
    assert "not declared" not in words
    assert "cannot <draw>" in words
    assert "0.75 (0.505 to 0.8982)" in words


def test_what_no_engine_declares_is_red_and_what_one_declares_amber() -> None:
    whole = comparison()
    contact = whole.layers[0]
    assert declares("b declares of contacts: soft", "a", "b")
    assert not declares("ab declares of contacts: soft", "a", "b"), "the name of another engine ends alike"
    bounce, drop = contact.measures
    quiet = bounce._replace(explanation="A remark that accuses no engine.")
    for measure, kind, other in ((bounce, "known", "off"), (quiet, "off", "known")):
        text = page(whole._replace(layers=(contact._replace(measures=(measure, drop)), *whole.layers[1:])))
        assert [cell.text for cell in parsed(text).xpath(f"//td[@class='n {kind}']")] == ["0.31"]
        assert not parsed(text).xpath(f"//td[@class='n {other}']")
    assert "differ, not declared" in text
    assert "With differences that no engine declares: <b>contact</b>" in text


def test_the_page_ranks_nobody() -> None:
    text = page(comparison())
    assert "nearest" not in text.lower()
    assert "This is no ranking" in text


def test_the_page_is_the_same_every_time() -> None:
    assert page(comparison()) == page(comparison())


def test_data_is_json_without_numbers_that_are_none() -> None:
    data = json.loads(json.dumps(as_data(comparison()), allow_nan=False))
    assert data["differ"] == 2
    assert data["layers"][0]["plots"][0]["series"][0]["y"] == [0.0, 1.0, None]
    assert data["layers"][0]["measures"][0]["nearest"] == ["a"]
    assert data["layers"][1]["refused"] == {"c": "cannot <draw>"}


def test_a_report_is_written_whole_and_replaces_an_earlier_one_alone(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "report"
    first = write(comparison(), out)
    text = first.html.read_bytes()
    second = write(comparison(), out)
    assert second.html.read_bytes() == text
    assert [p.name for p in out.parent.iterdir()] == ["report"]
    assert sorted(p.name for p in out.iterdir()) == ["compare.html", "compare.json"]
    (out / "notes.txt").write_text("mine")
    with pytest.raises(AnysimError, match="is no comparison"):
        write(comparison(), out)
    assert (out / "notes.txt").read_text() == "mine"


def test_without_matplotlib_the_numbers_are_written_and_the_remedy_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    written = write(comparison(), tmp_path / "report")
    assert written.html is None
    assert "pip install 'anysim[report]'" in written.trouble
    assert json.loads(written.json.read_text())["name"] == "pick"
    assert [p.name for p in (tmp_path / "report").iterdir()] == ["compare.json"]
