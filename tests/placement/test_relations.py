"""Relations and regions of entries, which hold in every episode."""

import numpy as np
import pytest

from anysim.errors import SpecError, TaskError
from tests.placement.helpers import Layouts

BOX = {"source": {"box": [0.06, 0.04, 0.05]}}
BALL = {"source": {"sphere": 0.03}}
SPIN = {"range": [-3.0, 3.0]}


def test_on_an_object_alone_is_anywhere_on_it_and_all_of_it_stays_on() -> None:
    pose = Layouts({"a": BOX}, {"a": {"on": "table", "yaw": SPIN}}, 64).reset()["a"]
    assert np.allclose(pose[:, 2], 0.4 + 0.025)
    assert (np.abs(pose[:, 0]) < 0.4 - 0.02).all()
    assert (np.abs(pose[:, 1]) < 0.5 - 0.02).all()
    assert np.ptp(pose[:, 0]) > 0.5
    assert np.ptp(pose[:, 1]) > 0.7


@pytest.mark.parametrize(
    ("region", "inside"),
    [
        ({"rectangle": [[0.0, 0.1], [0.2, 0.3]]}, lambda x, y: (x >= 0) & (x <= 0.2) & (y >= 0.1) & (y <= 0.3)),
        ({"circle": {"center": [0.1, 0.1], "radius": 0.1}}, lambda x, y: np.hypot(x - 0.1, y - 0.1) <= 0.1),
        (
            {"polygon": [[-0.3, -0.3], [0.3, -0.3], [0.3, -0.2], [-0.2, -0.2], [-0.2, 0.3], [-0.3, 0.3]]},
            lambda x, y: (np.abs(x) <= 0.3) & (np.abs(y) <= 0.3) & ((x <= -0.2 + 1e-9) | (y <= -0.2 + 1e-9)),
        ),
        ({"rectangle": [[0.1, 0.0], [0.3, 0.2]], "of": "table"}, lambda x, y: (x >= 0.1) & (x <= 0.3) & (y >= 0)),
        ("spot", lambda x, y: np.hypot(x, y) <= 0.05),
    ],
)
def test_a_region_holds_the_origin(region, inside) -> None:
    layouts = Layouts(
        {"a": BALL}, {"a": {"on": "table", "region": region}}, 32, regions={"spot": {"circle": {"radius": 0.05}}}
    )
    pose = layouts.reset()["a"]
    assert inside(pose[:, 0], pose[:, 1]).all()
    assert len(np.unique(pose[:, 0])) == 32


def test_near_is_the_distance_between_the_shapes() -> None:
    layouts = Layouts(
        {"a": BOX, "b": BOX},
        {"a": {"on": "table", "yaw": SPIN}, "b": {"near": {"of": "a", "distance": [0.02, 0.05]}, "yaw": SPIN}},
        16,
    )
    pose = layouts.reset()
    assert np.allclose(pose["b"][:, 2], 0.425), "it rests on what the other rests on"
    for env in range(16):
        assert 0.02 - 2e-6 <= layouts.gaps(pose, env)["a", "b"] <= 0.05 + 2e-6


@pytest.mark.parametrize(
    ("side", "axis", "sign"), [("left_of", 1, 1.0), ("right_of", 1, -1.0), ("in_front_of", 0, 1.0), ("behind", 0, -1.0)]
)
@pytest.mark.parametrize("axes", ["world", "own"])
def test_sides(side: str, axis: int, sign: float, axes: str) -> None:
    layouts = Layouts(
        {"a": BOX, "b": BALL},
        {
            "a": {"on": "table", "region": {"circle": {"radius": 0.1}}, "yaw": SPIN},
            "b": {side: {"of": "a", "distance": [0.01, 0.1], "axes": axes}},
        },
        16,
    )
    pose = layouts.reset()
    for env in range(16):
        a, b = pose["a"][env], pose["b"][env]
        yaw = 2 * np.arctan2(a[5], a[6]) if axes == "own" else 0.0
        d = b[:2] - a[:2]
        local = np.array([np.cos(yaw) * d[0] + np.sin(yaw) * d[1], -np.sin(yaw) * d[0] + np.cos(yaw) * d[1]])
        assert sign * local[axis] > 0.03 + 0.01, "beyond both half sizes"
        assert abs(local[1 - axis]) < 0.04, "beside, not at an angle"
        assert layouts.gaps(pose, env)["a", "b"] >= 0.01 - 1e-6


def test_facing_and_aligned() -> None:
    pose = Layouts(
        {"a": BOX, "b": BOX, "c": BOX, "d": BALL},
        {
            "d": {"on": "table", "region": {"circle": {"radius": 0.05}}},
            "a": {"near": {"of": "d", "distance": [0.05, 0.2]}, "facing": "d"},
            "b": {"on": "table", "region": {"rectangle": [[-0.1, 0.3], [0.1, 0.4]]}, "yaw": {"range": [-0.3, 0.3]}},
            "c": {
                "on": "table",
                "region": {"rectangle": [[-0.3, -0.45], [0.3, -0.2]]},
                "aligned": {"of": "b", "along": "y"},
            },
        },
        8,
    ).reset()
    heading = {name: 2 * np.arctan2(p[:, 5], p[:, 6]) for name, p in pose.items()}
    towards = pose["d"][:, :2] - pose["a"][:, :2]
    assert np.allclose(np.exp(1j * heading["a"]), np.exp(1j * np.arctan2(towards[:, 1], towards[:, 0])))
    assert np.allclose(np.exp(1j * heading["c"]), np.exp(1j * heading["b"]))
    line = pose["c"][:, :2] - pose["b"][:, :2]
    assert np.allclose(line[:, 0] * np.cos(heading["b"]) + line[:, 1] * np.sin(heading["b"]), 0.0, atol=1e-9)


def test_under_a_table_with_legs(tmp_path) -> None:
    top = {"roof": {"source": {"box": [0.3, 0.3, 0.02]}, "fixed": True}}
    pose = Layouts(
        {**top, "a": BALL}, {"roof": {"position": [0.0, 0.0, 0.6]}, "a": {"on": "table", "under": "roof"}}, 16
    ).reset()["a"]
    assert np.allclose(pose[:, 2], 0.43)
    assert (np.abs(pose[:, :2]) <= 0.15 - 0.03 + 1e-9).all()


def test_clearances_are_those_of_the_real_shapes_both_ways() -> None:
    rod = {"source": {"box": [0.5, 0.02, 0.02]}}
    layouts = Layouts(
        {"a": rod, "b": BALL, "c": BALL},
        {
            "a": {"on": "table", "x": 0.0, "y": 0.0, "clearance": 0.04},
            "b": {"on": "table", "clear_of": {"c": 0.2}},
            "c": {"on": "table"},
        },
        16,
    )
    pose = layouts.reset()
    gaps = [layouts.gaps(pose, env) for env in range(16)]
    assert min(g["a", "b"] for g in gaps) >= 0.04 - 1e-6
    assert min(g["b", "c"] for g in gaps) >= 0.2 - 1e-6
    assert min(g["a", "b"] for g in gaps) < 0.2, "a ball around the rod would have kept it away"


def test_alternatives_by_weight_and_ratio() -> None:
    layouts = Layouts(
        {"a": BALL},
        {
            "a": {
                "on": "table",
                "any_of": [{"x": 0.2, "weight": 3.0}, {"x": -0.2, "y": {"range": [0.0, 0.1]}}],
                "ratio": 0.5,
                "otherwise": {"position": [0.0, 0.0, 1.0]},
            }
        },
        400,
    )
    pose = layouts.reset()["a"]
    high = pose[:, 2] > 0.9
    assert 0.4 < high.mean() < 0.6
    right = pose[~high, 0] > 0
    assert 0.65 < right.mean() < 0.85
    assert (pose[~high][~right, 1] > 0).all()
    drawn = layouts.streams.draws[int(np.flatnonzero(~high & (pose[:, 0] < 0))[0])]
    assert drawn["layout/a/any_of"] == 1
    assert "layout/a/y" in drawn


def test_stable_poses_touch_with_a_face() -> None:
    pose = Layouts(
        {"a": {"source": {"box": [0.04, 0.08, 0.12]}}}, {"a": {"on": "table", "rest": "stable"}}, 200
    ).reset()
    height = np.round(pose["a"][:, 2] - 0.4, 6)
    assert set(height) == {0.02, 0.04, 0.06}
    assert (height == 0.02).mean() > (height == 0.04).mean() > (height == 0.06).mean()


def test_what_scatter_has_no_room_for_is_packed() -> None:
    things = {f"t{k}": {"source": {"box": [0.1, 0.1, 0.05]}} for k in range(9)}
    small = {"small": {"source": {"box": [0.31, 0.31, 0.02]}, "fixed": True}}
    layouts = Layouts(
        {**small, **things}, {"small": {"position": [0, 0, 0.5]}, **{name: {"on": "small"} for name in things}}, 2
    )
    pose = layouts.reset()
    for env in range(2):
        assert (
            min(g for (a, b), g in layouts.gaps(pose, env).items() if a[0] == b[0] == "t" and "table" not in (a, b)) > 0
        )


def test_what_does_not_fit_is_named_with_its_support_and_the_room() -> None:
    things = {f"t{k}": {"source": {"box": [0.1, 0.1, 0.05]}} for k in range(10)}
    small = {"small": {"source": {"box": [0.31, 0.31, 0.02]}, "fixed": True}}
    layouts = Layouts(
        {**small, **things}, {"small": {"position": [0, 0, 0.5]}, **{name: {"on": "small"} for name in things}}, 1
    )
    with pytest.raises(
        TaskError, match=r"env 0: no place for 't\d'.*'t\d'.*0\.0961 m\^2 of 'small'.*widen world\.layout"
    ):
        layouts.reset()


def test_a_relation_that_cannot_hold_is_named() -> None:
    layouts = Layouts(
        {"a": BALL, "b": BALL},
        {"a": {"on": "table", "x": 0.35, "y": 0.0}, "b": {"in_front_of": {"of": "a", "distance": [0.1, 0.2]}}},
        1,
    )
    with pytest.raises(TaskError, match=r"no place for 'b'.*stick out over the edge"):
        layouts.reset()


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        (
            {"near": "cup", "on": "table"},
            r"layout\.a\.near\.of: there is no object 'cup' that its place could refer to",
        ),
        ({"on": "table", "region": "corner"}, r"there is no region 'corner'"),
        ({"on": "table.shelf_1"}, r"'table' has no surface 'shelf_1' \(surfaces: top\)"),
        ({"in": "table"}, r"'table' has no inside with a level floor"),
        ({"near": "a", "on": "table"}, r"depend on each other in a circle: a on a"),
        ({"on": "table", "clear_of": {"b": 0.1}}, r"there is no object 'b' to stay clear of"),
        ({"near": "table"}, r"it is not known what 'table' rests on"),
    ],
)
def test_names_that_do_not_exist(entry: dict, words: str) -> None:
    with pytest.raises(SpecError, match=words):
        Layouts({"a": BALL}, {"a": entry})
