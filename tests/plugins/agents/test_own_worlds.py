"""Worlds that agents write: the same errors as those of files, no way to a file, and limits."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

import anysim
from anysim.errors import SpecError
from anysim_agents import worlds
from anysim_agents.limits import AGENT
from anysim_inspect.cli.check import report_on
from anysim_schemas.nodes import from_data
from tests.plugins.agents.helpers import Caller, replace, used

GOOD = """\
engine: "null"
world:
  objects:
    shelf: {source: {box: [1.0, 1.0, 0.4]}, fixed: true, label: a shelf / a rack}
    ball: {source: {sphere: 0.03}, mass: 0.2, color: red}
    cup: {source: {procedural: bowl}, mass: 0.1}
  layout:
    shelf: {position: [0.0, 0.0, 0.2]}
    ball: {on: shelf, x: {range: [-0.4, -0.1]}, y: 0.2}
    cup: {on: shelf, x: {range: [0.1, 0.4]}, y: 0.2}
task:
  description: "Look at the ball; see https://example.org/a.png for one."
  observations: {policy: [{term: frame_pose, frame: ball}]}
"""
"""What an agent may write; text for people is not looked at."""

NAMES = (
    *("/etc/passwd", "../x", "a/../../x", "~/x", "~", "..", "./x", ".ssh", "a\\b", "x\0y"),
    *("file:x", "file:/x", "package:anysim/x", "PACKAGE:anysim/x", "robot_descriptions:panda_description"),
    *("example-robot-data:x/y", "https://a.b/c", "x.yaml", "x.YML", "x.obj", "x.urdf", "x.xml#body", "secret/x.txt"),
    *("x.onnx", "x.png", "x.npz", "procedural:../x", "procedural:/x"),
)


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Where the data has texts."""
    if isinstance(value, dict):
        return [found for key, item in value.items() for found in places(item, (*path, key))]
    if isinstance(value, list):
        return [found for number, item in enumerate(value) for found in places(item, (*path, number))]
    return [path] if isinstance(value, str) else []


def with_text(data: Any, path: tuple[Any, ...], text: str) -> Any:
    """The data with another text at a place."""
    if not path:
        return text
    copy = data.copy()
    copy[path[0]] = with_text(data[path[0]], path[1:], text)
    return copy


def refusals(text: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        worlds.read(text, AGENT)
    return [str(issue) for issue in caught.value.issues]


def test_what_is_good_is_a_session(tmp_path: Path) -> None:
    path = tmp_path / "good.yaml"
    path.write_text(GOOD)

    async def scenario(tool: Caller) -> None:
        report = await tool("check_world", yaml=GOOD)
        assert report == {"ok": True, "faults": [], "warnings": report["warnings"], "engines": {"null": worlds.RUNS}}
        made = await tool("create_world", yaml=GOOD, num_envs=2, seed=4)
        assert made["things"] == ["shelf", "ball", "cup"]
        seen = await tool("observe", session="s1", env=1)
        with anysim.make(path, num_envs=2) as env:  # the same world and episode as of a file
            env.reset(seed=4)
            ball = next(e.root for e in env.engine.world.entities if e.name == "ball")
            assert seen["things"]["ball"]["position"] == [
                round(float(v), 4) for v in env.engine.get_state().body_pose[1, ball, :3]
            ]
        extended = "extends: task:pick_cube\n"
        extended += "world: {objects: {ball: {source: {sphere: 0.03}}}, layout: {ball: {on: table, x: 0.5, y: 0.2}}}\n"
        assert (await tool("check_world", yaml=extended))["ok"]

    used(scenario)


def test_faults_are_those_of_a_file_with_line_and_column(tmp_path: Path) -> None:
    wrong = (
        GOOD.replace("sphere: 0.03", "spher: 0.03")
        .replace("mass: 0.1", "mass: -1")
        .replace("on: shelf, x: {range: [0.1", "on: shef, x: {range: [0.1")
    )
    wrong = wrong.replace("frame: ball", "frame: bal")
    path = tmp_path / "world.yaml"
    path.write_text(wrong)
    expected = [fault.replace(str(path), worlds.NAME) for fault in report_on(str(path), None, False, []).faults]
    found = worlds.report(wrong, AGENT, False)
    assert len(expected) >= 2
    assert found["faults"] == expected
    assert all(fault.startswith("world.yaml:") for fault in found["faults"])
    later = GOOD.replace("frame: ball", "frame: bal").replace("on: shelf, x: {range: [0.1", "on: shef, x: {range: [0.1")
    path.write_text(later)  # what only compiling finds
    expected = [fault.replace(str(path), worlds.NAME) for fault in report_on(str(path), None, False, []).faults]
    assert worlds.report(later, AGENT, False)["faults"] == expected != []


@pytest.mark.parametrize("text", ["a: [", "- 1", "x", "", "a: &b [*b]", "a: !!python/object:os.system x", "\x00"])
def test_what_is_no_world_is_told_in_a_sentence(text: str) -> None:
    report = worlds.report(text, AGENT, False)
    if text:
        assert report["faults"], text
        assert all(fault.startswith("world.yaml") for fault in report["faults"])


def test_no_text_in_any_place_leads_to_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each text of two worlds is replaced by each name of a file, and is refused before anything is read."""
    monkeypatch.chdir(tmp_path)
    Path("good.yaml").write_text(GOOD)
    data, task = (json.loads(json.dumps(dict(anysim.load(source).data))) for source in ("good.yaml", "put_away"))
    counted = 0
    for source in (data, task):
        for path in places(source):
            for name in NAMES if path[-1] not in worlds.PROSE else ():
                faults = list(worlds._leading_out(from_data(with_text(source, path, name)), ()))
                assert any(fault.path == ".".join(map(str, path)) for fault in faults), (path, name)
                counted += 1
    assert counted > 500
    assert not list(worlds._leading_out(from_data(data), ()))
    for key in sorted(worlds.FILE_KEYS):
        assert "cannot name a file" in refusals(f"world: {{objects: {{a: {{source: {{{key}: plain}}}}}}}}")[0]
    for line in ("extends: plain", "extends: ../x.yaml", "extends: [task:pick_cube, other.yaml]", "extends: task:../x"):
        assert any("extends installed tasks alone" in one for one in refusals(line)), line
    assert "by its name alone" in refusals("engine: {name: mujoco, options: {}}")[0]
    assert "by its name alone" in refusals("engine: {name: mujoco, shards: 4}")[0]


def test_a_file_that_is_there_is_neither_read_nor_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "secret").write_text("hidden: words\n")
    (tmp_path / "mug").write_bytes(b"solid secret")
    for text in (
        "extends: secret",
        "world: {objects: {a: {source: {mesh: mug}}}}",
        "world: {objects: {a: {source: mug}}}",
    ):
        report = worlds.report(text, AGENT, False)
        assert not report["ok"]
        assert "hidden" not in json.dumps(report)
        assert str(tmp_path) not in json.dumps(report)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["mug", "secret"]


def test_a_skill_takes_no_file_from_an_agent() -> None:
    text = "extends: task:pick_cube\ntask: {expert: {skill: pick, object: cube, goal: goal, bank: plain}}\n"
    assert "bank" in refusals(text)[0]

    async def scenario(tool: Caller) -> None:
        await tool("create_session")
        for key in ("bank", "living"):
            arguments = {"object": "red", key: "plain"}
            words = await tool.refused("run_skill", session="s1", skill="grasp", parameters=arguments)
            assert f"parameters.{key}: it names a file" in words
        words = await tool.refused("run_skill", session="s1", skill="watch", parameters={"target": "../red"})
        assert "cannot name a file" in words

    used(scenario)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"world": {"objects": {"a": {"source": {"box": [0.1, 0.1, 0.1]}, "count": 4000}}}}, "at most 200"),
        ({"world": {"cameras": {"a": {"from": [1, 1, 1], "look_at": [0, 0, 0], "size": [4096, 4096]}}}}, "pixels"),
        ({"world": {"families": {f"p{i}": {"kind": "avatar"} for i in range(9)}}}, "at most 8"),
        ({"physics": {"dt": 0.00001}}, "physics steps in a control step"),
        ({"task": {"horizon": 10**8, "observations": {"policy": ["last_action"]}}}, "at most 100000"),
    ],
    ids=["things", "pixels", "families", "substeps", "horizon"],
)
def test_a_world_beyond_the_limits_is_refused(change: dict[str, Any], words: str) -> None:
    assert any(words in one for one in refusals(yaml.safe_dump(change)))


def test_the_text_is_limited_too() -> None:
    assert "at most 100 are taken" in worlds.report("#" * 101, replace(AGENT, yaml_bytes=100), False)["faults"][0]
