"""Generated ground: pieces of every kind, and tiles of them."""

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from anysim.compile.world import compile_world
from anysim.errors import SpecError
from anysim.model.world import World
from anysim_assets.terrain.generators import GENERATORS, generate
from anysim_schemas.run import WorldSpec
from anysim_schemas.terrain import GENERATED, TerrainSpec

KINDS = sorted(GENERATED)


def made(terrain: Any, **more: Any) -> World:
    return compile_world(WorldSpec.model_validate({"terrain": terrain, **more}))


def heights(kind: str, difficulty: float, seed: int = 3, cell: float = 0.1, **parameters: Any) -> np.ndarray:
    spec = TerrainSpec.model_validate({"kind": kind, **parameters})
    return generate(kind, spec.parameters(kind), difficulty, (8.0, 8.0), cell, (seed,)).heights


# ---------------------------------------------------------------------- generators


@pytest.mark.parametrize("kind", KINDS)
def test_pieces_are_flat_in_the_middle_and_level_at_their_edges(kind: str) -> None:
    for difficulty in (0.0, 0.5, 1.0):
        field = heights(kind, difficulty)
        middle = field[31:50, 31:50]  # within the platform of 2 m
        assert np.ptp(middle) == 0
        edges = np.concatenate([field[0], field[-1], field[:, 0], field[:, -1]])
        assert (edges == 0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_harder_ground_is_rougher(kind: str) -> None:
    """The steps between neighbours grow with the difficulty; for gaps and stones the share of missing ground."""

    def measure(difficulty: float) -> float:
        field = heights(kind, difficulty)
        if kind in ("gaps", "stepping_stones"):
            return float((field < -0.5).mean())
        return float(np.abs(np.diff(field, axis=1)).mean())

    levels = [measure(d) for d in np.linspace(0, 1, 6)]
    assert levels == sorted(levels)
    assert levels[-1] > 1.5 * levels[0]


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_seed_is_the_same_ground(kind: str) -> None:
    assert (heights(kind, 0.7) == heights(kind, 0.7)).all()
    random = kind in ("rough", "waves", "stepping_stones", "obstacles")
    assert (heights(kind, 0.7, seed=4) != heights(kind, 0.7)).any() == random


def test_parameters_are_physical() -> None:
    stairs = heights("stairs", 1.0, rise=[0.05, 0.2], tread=0.5)
    assert np.unique(stairs) == pytest.approx(
        [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
    )  # five treads fit between edge and platform
    row = stairs[40, :41]
    assert [int((row == value).sum()) for value in np.unique(row)[1:-1]] == [5, 5, 5, 5]
    pit = heights("slopes", 0.0, slope=0.3, down=True)
    assert np.diff(pit[40, 2:30]) == pytest.approx(-0.03, abs=1e-6)
    assert np.abs(heights("rough", 1.0, amplitude=0.1)).max() <= 0.1
    moat = heights("gaps", 0.0, gap=0.4, depth=0.7)[40, :41]
    assert (moat == -0.7).sum() + 1 == 4  # from the last node before it to the first behind it are 0.4 m
    blocks = heights("obstacles", 1.0, rise=0.25)
    assert 0.2 < blocks.max() <= 0.25
    assert blocks.min() == 0
    assert (heights("obstacles", 1.0, rise=0.25, down=True) == -blocks).all()
    row = heights("pits", 0.5, depth=[0.1, 0.3], platform=1.6)[40]
    assert row == pytest.approx([0.0] * 32 + [-0.2] * 17 + [0.0] * 32)
    bare, bumpy = (heights("slopes", 1.0, slope=0.2, amplitude=a, grain=0.4) for a in (0.0, [0.0, 0.05]))
    assert bare[40, 40] == pytest.approx(0.2 * 2.9)
    assert 0.03 < np.abs(bumpy - bare).max() <= 0.05
    shallow = heights("gaps", 0.5, gap=0.4, depth=[0.0, 0.6])
    assert set(np.unique(shallow)) == {-0.3, 0.0}


@pytest.mark.parametrize(
    ("terrain", "message"),
    [
        (
            {"kind": "stairs", "amplitude": 0.1},
            "`amplitude` is a parameter of rough, waves, slopes; stairs has rise, tread",
        ),
        ({"kind": "plane", "rise": 0.1}, "kind plane is not generated"),
        ({"kind": "trimesh"}, "needs a `file`"),
        ({"kind": "heightfield"}, "needs `heights`, or a `file`"),
        ({"kind": "heightfield", "heights": [[0, 0], [0, 0]], "file": "a.npy"}, "either `heights` or `file`"),
        ({"kind": "rough", "file": "a.npy"}, "`file` goes with kind heightfield or trimesh; this is rough"),
        ({"kind": "plane", "difficulty": 0.2}, "`difficulty` goes with kind rough"),
        ({"kind": "rough", "platform": 12.0}, "a platform of 12 m does not fit into 10 m"),
        ({"kind": "obstacles", "block": [1.0, 0.5]}, "shortest edge 1 is above the longest 0.5"),
        ({"kind": "tiles", "tiles": {"columns": [{"kind": "gaps", "rise": 1}]}}, "gaps has gap, depth"),
        ({"kind": "tiles", "tiles": {"difficulty": [0.6, 0.5]}}, "the first row 0.6 is harder"),
        ({"kind": "tiles", "tiles": {"start": 1}}, "`start` is for `choose: curriculum`"),
        ({"kind": "tiles", "tiles": {"start": 9, "choose": "curriculum"}}, "levels go from 0 to 4 with 5 rows, got 9"),
    ],
)
def test_what_does_not_fit_is_said(terrain: Any, message: str) -> None:
    with pytest.raises(ValidationError, match=message.replace("[", r"\[")):
        TerrainSpec.model_validate(terrain)


@pytest.mark.parametrize(
    ("terrain", "path", "message"),
    [
        ({"kind": "stairs", "tread": 0.15}, "terrain", "`tread` of 0.15 m needs cells of 0.075 m or less"),
        ({"kind": "stairs", "size": [2.8, 2.8]}, "terrain", "0.3 m between the platform and the edge are too little"),
        ({"kind": "rough", "size": [3.05, 3]}, "terrain", "3.05 m is no whole number"),
        (
            {"kind": "tiles", "tiles": {"columns": ["rough", {"kind": "gaps", "gap": 0.1}]}},
            "terrain.tiles.columns.1",
            "`gap` of 0.1 m needs cells",
        ),
        ({"kind": "plane", "color": "gren"}, "terrain.color", "did you mean 'green'"),
    ],
)
def test_what_cannot_be_generated_is_said(terrain: Any, path: str, message: str) -> None:
    with pytest.raises(SpecError, match=message) as caught:
        made(terrain)
    assert caught.value.issues[0].path == path


@pytest.mark.parametrize("kind", KINDS)
def test_the_platform_is_at_the_origin(kind: str) -> None:
    world = made({"kind": kind, "difficulty": 1.0}, objects={"cube": {"source": {"box": [0.1, 0.1, 0.1]}}})
    assert world.ground.heights_at(np.array([[0.0, 0.0], [0.9, -0.9]])) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert world.bodies[0].position == pytest.approx((0, 0, 0.05))


def test_height_fields_are_stiffer_than_a_plane_and_rub_alike() -> None:
    field, plane = (made({"kind": kind, "friction": 0.6}).geoms[0].surface for kind in ("rough", "plane"))
    assert (field.softness, plane.softness) == (0.01, 0.0)
    assert field.friction == plane.friction == 0.6


# ---------------------------------------------------------------------- tiles


def test_tiles_share_their_borders_and_have_an_origin_each() -> None:
    world = made({"kind": "tiles", "seed": 5, "tiles": {"rows": 3, "columns": KINDS, "size": 6.0, "border": 1.0}})
    assert len(world.tiles) == 3 * len(KINDS)
    assert world.tiles[0].origin == (0.0, 0.0, 0.0)
    assert [t.difficulty for t in world.tiles if t.column == 0] == [0.0, 0.5, 1.0]
    origins = np.array([tile.origin for tile in world.tiles])
    around = np.array([[0, 0], [0.9, 0.9], [-0.9, 0.9], [0.9, -0.9]])
    for shift in around:
        assert world.ground.heights_at(origins[:, :2] + shift) == pytest.approx(origins[:, 2], abs=1e-6)
    # the lattice of edges is level with the flat ground outside
    low = float(world.ground.heights_at(np.array([-3.5, -3.5])))
    for tile in world.tiles:
        x, y, _ = tile.origin
        edge = np.linspace(-3.0, 3.0, 25)
        for points in ([x - 3.0, None], [x + 3.0, None], [None, y - 3.0], [None, y + 3.0]):
            at = np.stack(
                [
                    edge + x if points[0] is None else np.full(25, points[0]),
                    edge + y if points[1] is None else np.full(25, points[1]),
                ],
                axis=-1,
            )
            assert world.ground.heights_at(at) == pytest.approx(low, abs=1e-9)


def test_tiles_are_part_of_the_hash_and_equal_specs_are_equal_worlds() -> None:
    spec = {"kind": "tiles", "tiles": {"rows": 2, "size": 4.0}}
    assert made(spec).hash == made(spec).hash
    assert made(spec).hash != made({**spec, "seed": 1}).hash
    columns = ["rough", "slopes", "stairs", "obstacles", {"kind": "gaps", "gap": 0.3}]
    more = made({**spec, "tiles": {"rows": 2, "size": 4.0, "columns": columns}})
    # a further column changes no tile that was there
    assert [t for t in more.tiles if t.column < 4] == list(made(spec).tiles)
    n = made(spec).heightfields[0].heights.shape[0] - 21
    assert (more.heightfields[0].heights[:n] == made(spec).heightfields[0].heights[:n]).all()


def test_generators_are_all_there() -> None:
    assert set(GENERATORS) == set(GENERATED)
