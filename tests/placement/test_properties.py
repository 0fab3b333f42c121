"""Whatever is asked for: what is given is apart, the same again, and independent of what else there is."""

import numpy as np
from hypothesis import given, settings, strategies as st

from anysim.errors import TaskError
from anysim.geometry import polygon as G
from tests.placement.helpers import Layouts

SIZE = st.floats(0.02, 0.12).map(lambda v: round(v, 3))
SOURCE = st.one_of(
    st.tuples(SIZE, SIZE, SIZE).map(lambda s: {"box": list(s)}),
    SIZE.map(lambda r: {"sphere": round(r / 3, 4)}),
    st.tuples(SIZE, SIZE).map(lambda s: {"cylinder": [round(s[0] / 3, 4), s[1]]}),
    st.tuples(SIZE, SIZE).map(lambda s: {"capsule": [round(s[0] / 3, 4), s[1]]}),
)
PLACE = st.fixed_dictionaries(
    {"on": st.just("table"), "yaw": st.just({"range": [-3.0, 3.0]}), "rest": st.sampled_from(["given", "stable"])},
    optional={"clearance": st.sampled_from([0.0, 0.01, 0.03])},
)
THINGS = st.lists(st.tuples(SOURCE, PLACE), min_size=1, max_size=10)


def layouts_of(things, num_envs=2, first=0):
    names = {f"t{k + first}": thing for k, thing in enumerate(things)}
    return Layouts(
        {n: {"source": source} for n, (source, _) in names.items()},
        {n: place for n, (_, place) in names.items()},
        num_envs,
    )


@settings(max_examples=25)
@given(THINGS, st.integers(0, 1000))
def test_everything_is_apart_on_the_table_and_the_same_again(things, seed) -> None:
    layouts = layouts_of(things)
    try:
        pose = {name: rows.copy() for name, rows in layouts.reset(seed).items()}
    except TaskError:  # that it says what does not fit is tested elsewhere
        return
    asked = {f"t{k}": place.get("clearance", 0.0) for k, (_, place) in enumerate(things)}
    for env in range(2):
        for (a, b), gap in layouts.gaps(pose, env).items():
            wanted = 0.0 if "table" in (a, b) else max(asked[a], asked[b])
            assert gap >= (wanted - 2e-6 if wanted else -1e-4), (a, b)
    again = layouts.reset(seed)
    assert all(np.array_equal(pose[name], again[name]) for name in pose)
    alone = layouts_of(things, 1).reset(seed)
    assert all(np.array_equal(pose[name][:1], alone[name]) for name in pose)


@settings(max_examples=15)
@given(THINGS, st.integers(0, 1000))
def test_one_more_thing_moves_no_draw_of_the_others(things, seed) -> None:
    """Later entries leave earlier ones where they are as long as nobody has to make room."""
    fewer, more = layouts_of(things[:-1] or things, 1), layouts_of(things, 1)
    try:
        a, b = fewer.reset(seed), more.reset(seed)
    except TaskError:
        return
    drawn, others = fewer.streams.draws[0], more.streams.draws[0]
    kept = [name for name in a if np.array_equal(a[name], b[name])]
    assert all(drawn[key] == others[key] for key in drawn if key.split("/")[1] in kept)
    if len(things) < 6:
        assert len(kept) == len(a)


POINT = st.tuples(st.floats(-1, 1), st.floats(-1, 1)).map(lambda p: (round(p[0], 3), round(p[1], 3)))
UNIT = st.floats(0, 0.999)


@settings(max_examples=100)
@given(st.lists(POINT, min_size=3, max_size=12), st.tuples(UNIT, UNIT, UNIT))
def test_points_of_an_area_are_inside(points, numbers) -> None:
    outline = G.hull(points)
    if len(outline) < 3 or G.size(outline) < 1e-4:
        return
    assert G.holds((outline,), *G.point_in((outline,), *numbers), slack=1e-7)
    half = G.cut(outline, 1.0, 0.0, G.center((outline,))[0])
    rest = G.cut(outline, -1.0, 0.0, -G.center((outline,))[0])
    assert abs(G.size(half) + G.size(rest) - G.size(outline)) < 1e-9


def test_points_are_spread_evenly_over_an_area() -> None:
    rng = np.random.default_rng(0)
    area = (G.rectangle((0.0, 0.0), (2.0, 1.0)), G.rectangle((3.0, 0.0), (4.0, 1.0)))
    points = np.array([G.point_in(area, *rng.random(3)) for _ in range(4000)])
    assert abs((points[:, 0] > 2.5).mean() - 1 / 3) < 0.03
    assert abs(points[points[:, 0] < 2.5, 0].mean() - 1.0) < 0.05


def test_a_bent_polygon_is_cut_into_all_of_itself() -> None:
    corners = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    assert G.total(G.convex_parts(corners)) == 3.0
    assert not G.holds(G.convex_parts(corners), 1.5, 1.5)
