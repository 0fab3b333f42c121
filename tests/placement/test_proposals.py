"""Poses that somebody else proposes: checked, repaired within bounds, refused with sentences, replayed."""

import json

import numpy as np
import pytest

from anysim.errors import SpecError, TaskError
from tests.placement.helpers import Layouts
from tests.task.helpers import BLOCKS

OBJECTS = {"a": {"source": {"box": [0.06, 0.04, 0.05]}}, "b": {"source": {"sphere": 0.03}}}
LAYOUT = {"a": {"on": "table"}, "b": {"on": "table"}}


def propose(**poses):
    return {"poses": poses}


def test_a_proposal_is_kept_and_the_rest_is_drawn() -> None:
    layouts = Layouts(OBJECTS, LAYOUT, 2, propose(a={"position": [0.1, 0.2, 0.425], "yaw": 0.5}))
    pose = layouts.reset()
    assert np.allclose(pose["a"][:, :3], [0.1, 0.2, 0.425])
    assert np.allclose(2 * np.arctan2(pose["a"][:, 5], pose["a"][:, 6]), 0.5)
    assert not np.allclose(pose["b"][0], pose["b"][1])


def test_it_is_dropped_set_upright_and_pushed_apart_within_the_bounds() -> None:
    tilt = [0.05, 0.0, 0.0, float(np.sqrt(1 - 0.05**2))]
    layouts = Layouts(
        OBJECTS,
        LAYOUT,
        1,
        propose(a={"position": [0.0, 0.0, 0.46], "quaternion": tilt}, b={"position": [0.035, 0.0, 0.43]}),
    )
    pose = layouts.reset()
    assert np.allclose(pose["a"][0], [0, 0, 0.425, 0, 0, 0, 1])
    assert 0 < np.linalg.norm(pose["b"][0, :2] - [0.035, 0.0]) <= 0.05 + 1e-9
    assert layouts.gaps(pose, 0)["a", "b"] > -1e-4


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        ({"c": {"position": [0, 0, 0]}}, "there is no object 'c' to place"),
        ({"a": {"position": [0, 0, 0.9]}}, r"'a' is proposed 0\.475 m above its support"),
        ({"a": {"position": [2.0, 0, 0.4]}}, r"'a' is proposed at x 2, y 0, which is not above 'table'"),
        ({"a": {"position": [0, 0, 0.4], "quaternion": [0, 0, 0, 2]}}, "has the length 2, not 1"),
        ({"a": {"position": [0, 0, 0.9]}, "b": {"position": [3, 0, 0.4]}}, r"'a' is proposed.*; 'b' is proposed"),
    ],
)
def test_what_cannot_be_is_refused_with_a_sentence_each(poses, words) -> None:
    with pytest.raises(TaskError, match=words):
        Layouts(OBJECTS, LAYOUT, 1, propose(**poses)).reset()


def test_conditions_of_the_layout_hold_for_proposals_too() -> None:
    layout = {"a": {"on": "table", "region": {"circle": {"radius": 0.05}}}, "b": {"on": "table"}}
    with pytest.raises(TaskError, match=r"'a' .*outside of its region"):
        Layouts(OBJECTS, layout, 1, propose(a={"position": [0.3, 0, 0.425]})).reset()


def test_a_refused_proposal_can_give_way_to_the_layout(tmp_path) -> None:
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(propose(a={"position": [0, 0, 3.0]})))
    source = {"proposal": str(path), "on_refusal": "layout"}
    layouts = Layouts(OBJECTS, LAYOUT, 2, layout_source=source)
    pose = layouts.reset()
    assert np.allclose(pose["a"][:, 2], 0.425)
    assert "above its support" in str(layouts.streams.draws[0]["layout/proposal_refused"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "no JSON"),
        ('{"poses": {"a": {}}}', r"poses\.a\.position"),
        ('{"poses": {}, "x": 1}', "x"),
        ('{"poses": {"a": {"position": [0, 0, Infinity]}}}', "finite"),
    ],
)
def test_a_document_of_another_form_is_refused(tmp_path, text: str, words: str) -> None:
    with pytest.raises(SpecError, match=words):
        Layouts(OBJECTS, LAYOUT, 1, text).reset()


def test_a_proposer_is_told_the_scene_and_what_it_says_is_in_the_record() -> None:
    asked = []

    def proposer(request):
        asked.append(request)
        shift = request.seed % 100 / 1000
        return propose(a={"position": [shift, 0.0, request.supports[0].height + request.things[1].bottom]})

    layouts = Layouts(OBJECTS, LAYOUT, 3, proposer)
    pose = layouts.reset(seed=4)
    assert [t.name for t in asked[0].things] == ["table", "a", "b"]
    assert asked[0].things[1].size == (0.06, 0.04, 0.05)
    assert asked[0].supports[0].name == "table.top"
    assert json.loads(asked[0].to_json())["scene"] == "world"
    again = Layouts(OBJECTS, LAYOUT, 3, lambda request: pytest.fail("asked in a replay"))
    for env in range(3):
        again.manager.recall(env, json.loads(json.dumps(layouts.streams.draws[env])))
    replayed = again.reset(seed=4)
    assert all(np.array_equal(pose[name], replayed[name]) for name in pose)


def test_a_file_beside_the_world(tmp_path) -> None:
    """Relative to the YAML that names it, wherever one is; `anysim check` reads it."""
    import anysim
    from anysim_inspect.cli.check import report_on

    (tmp_path / "plans").mkdir()
    (tmp_path / "plans" / "plan.json").write_text(json.dumps(propose(red={"position": [0.1, 0.2, 0.42]})))
    world = {"world": {**BLOCKS["world"], "layout_source": "plans/plan.json"}}
    (tmp_path / "world.yaml").write_text(json.dumps({**BLOCKS, **world}))
    with anysim.make(tmp_path / "world.yaml") as env:
        env.reset(seed=0)
        assert np.allclose(env.engine.get_state().body_pose[0, env.engine.index.body("red"), :3], [0.1, 0.2, 0.425])
    (tmp_path / "plans" / "plan.json").write_text('{"poses": {"red": {"position": [0.1]}}}')
    said = "\n".join(report_on(str(tmp_path / "world.yaml"), None, False, []).faults)
    assert "poses.red.position" in said


def test_each_episode_draws_one_of_several() -> None:
    several = [propose(a={"position": [x, 0.0, 0.425]}) for x in (-0.2, 0.0, 0.2)]
    pose = Layouts(OBJECTS, LAYOUT, 30, several).reset()["a"]
    assert set(np.round(pose[:, 0], 6)) == {-0.2, 0.0, 0.2}
