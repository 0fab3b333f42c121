"""Declared objects and what they become: entities, slots and categories."""

import tracemalloc
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim.compile import variants
from anysim.compile.collisions import with_exclusions
from anysim.compile.edit import without_entity
from anysim.compile.population import grid
from anysim.compile.variants import counts, sizes
from anysim.engine.requirements import needs_of
from anysim.errors import AssetError, Issues, NameLookupError, SpecError
from anysim.geometry.bounds import EntityShape
from anysim.model.frames import frames_of
from anysim.model.index import Index
from anysim.model.pairs import may_meet
from anysim.model.world import Box, World
from anysim_schemas.collisions import CollisionsSpec
from anysim_schemas.objects import ObjectSpec

BALL, BRICK = {"sphere": 0.05}, {"box": [0.1, 0.1, 0.2]}
Make = Callable[..., World]

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
CHEST = f"""<robot name="chest"><link name="box">{INERTIAL}
<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
<link name="lid">{INERTIAL}</link><joint name="hinge" type="revolute"><parent link="box"/><child link="lid"/>
<limit lower="0" upper="1" effort="5" velocity="2"/></joint>
<link name="handle"/><joint name="weld" type="fixed"><parent link="box"/><child link="handle"/>
<origin xyz="0.1 0 0"/></joint></robot>"""


def names(world: World) -> list[str]:
    return [entity.name for entity in world.entities]


def messages(make: Make, base: Path | None = None, **content: Any) -> str:
    with pytest.raises((SpecError, AssetError)) as error:
        make(base, **content)
    return str(error.value)


def tetrahedron(path: Path) -> None:
    path.write_text("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")


def test_an_object_of_one_source_stays_an_entity_of_its_name(world: Make) -> None:
    made = world(objects={"mug": {"source": BALL}})
    assert names(made) == ["mug"]
    assert made.slots == ()
    assert made.logical_objects["mug"].entities == (0,)


def test_several_sources_are_entities_of_one_slot_at_one_place(world: Make) -> None:
    made = world(objects={"mug": {"source": {"choice": [BALL, BRICK]}}}, layout={"mug": {"on": "terrain", "x": 0.3}})
    assert names(made) == ["mug~0", "mug~1"]
    (slot,) = made.slots
    assert (slot.name, slot.category, slot.instance, slot.entities) == ("mug", "mug", 0, (0, 1))
    assert made.initial_presence.tolist() == [True, False]
    assert [made.bodies[e.root].position for e in made.entities] == [(0.3, 0.0, 0.05), (0.3, 0.0, 0.1)]
    assert {e.label for e in made.entities} == {"mug"}


def test_a_count_makes_instances_and_each_has_its_sources(world: Make) -> None:
    made = world(objects={"cube": {"source": {"choice": [BALL, BRICK]}, "count": {"range": [1, 3]}, "label": "toy"}})
    assert names(made) == ["cube_0~0", "cube_0~1", "cube_1~0", "cube_1~1", "cube_2~0", "cube_2~1"]
    assert [slot.name for slot in made.categories["cube"]] == ["cube_0", "cube_1", "cube_2"]
    assert [slot.initially for slot in made.slots] == [True, True, False]  # two of 1 to 3 nominally
    assert made.initial_presence.tolist() == [True, False, True, False, False, False]
    assert {(e.category, e.label) for e in made.entities} == {("cube", "toy")}


def test_a_constant_count_varies_nothing(world: Make) -> None:
    made = world(objects={"cube": {"source": BALL, "count": 3}})
    assert names(made) == ["cube_0", "cube_1", "cube_2"]
    assert made.slots == ()
    assert [slot.instance for slot in made.categories["cube"]] == [0, 1, 2]
    places = np.array([made.bodies[e.root].position for e in made.entities])
    assert (np.diff(places[:, 0]) > 0.1).all()  # side by side, as nothing says where they are


def test_the_entry_of_a_category_holds_for_its_instances_but_where_one_has_its_own(world: Make) -> None:
    made = world(
        objects={"cube": {"source": BALL, "count": 3}, "plate": {"source": BRICK}},
        layout={"plate": {"on": "cube_1"}, "cube_2": {"position": [0, 0, 1]}, "cube": {"on": "terrain", "y": 0.5}},
    )
    place = {e.name: made.bodies[e.root].position for e in made.entities}
    assert place["cube_0"] == place["cube_1"] == (0.0, 0.5, 0.05)
    assert place["cube_2"] == (0.0, 0.0, 1.0)
    assert place["plate"] == (0.0, 0.5, 0.2)  # on cube_1, which the category's entry places first


def test_what_the_other_episodes_have_is_there_nominally(world: Make) -> None:
    source = {"choice": [BALL, BRICK], "ratio": 0.3, "otherwise": {"cylinder": [0.1, 0.1]}}
    made = world(objects={"mug": {"source": source}})
    assert made.slots[0].entities == (2, 0, 1)
    assert made.initial_presence.tolist() == [False, False, True]


def test_scale_is_for_every_kind_of_source_and_multiplies_that_of_the_source(world: Make, tmp_path: Path) -> None:
    tetrahedron(tmp_path / "t.obj")
    sources = [{"box": [0.1, 0.2, 0.3], "scale": 2}, {"cylinder": [0.1, 0.2]}, {"capsule": [0.1, 0.2]}, BALL, "t.obj"]
    for source in sources:
        plain, double = (
            world(tmp_path, objects={"a": {"source": source, "density": 100.0, "scale": scale}}) for scale in (1, 2)
        )
        low, high = (EntityShape(w, "a").bounds(np.array([0, 0, 0, 0, 0, 0, 1.0])) for w in (plain, double))
        assert np.allclose(2 * np.array(low), high)
        assert np.isclose(double.bodies[0].inertial.mass, 8 * plain.bodies[0].inertial.mass)
    shape = world(objects={"a": {"source": sources[0], "scale": 0.5}}).geoms[-1].shape
    assert shape == Box((0.05, 0.1, 0.15))


@pytest.mark.parametrize(
    ("scale", "expected", "nominal"),
    [
        ({"range": [0.5, 1.5]}, [0.6, 0.8, 1.0, 1.2, 1.4], 2),
        ({"log_uniform": [0.1, 10]}, [10**-0.8, 10**-0.4, 1.0, 10**0.4, 10**0.8], 2),
        ({"choice": [2, 3]}, [2, 3], 0),
        ({"range": [0.5, 1.5], "ratio": 0.5, "otherwise": 3}, [0.6, 0.8, 1.0, 1.2, 1.4, 3], 5),
        (2, [2], 0),
    ],
)
def test_a_range_of_scales_is_made_in_a_number_of_sizes(scale: Any, expected: list[float], nominal: int) -> None:
    found = sizes(ObjectSpec.model_validate({"source": BALL, "scale": scale}))
    assert np.allclose(found.values, expected)
    assert found.nominal == nominal
    assert (found.drawn is None) == (len(expected) == 1)


def test_sizes_of_a_normal_are_its_quantiles_and_stay_in_its_limits() -> None:
    scale = {"normal": {"mean": 1.0, "std": 0.2, "low": 0.9}}
    found = sizes(ObjectSpec.model_validate({"source": BALL, "scale": scale, "sizes": 3}))
    assert np.allclose(found.values, [0.9, 1.0, 1.0 + 0.2 * 0.967421566101701])  # the 5/6 quantile


def test_both_ends_of_a_range_of_counts_can_come() -> None:
    spec = ObjectSpec.model_validate({"source": BALL, "count": {"range": [2, 5]}})
    assert spec.count is not None
    assert counts(spec.count).values == (2, 3, 4, 5)


def test_a_folder_is_its_files_by_name(world: Make, tmp_path: Path) -> None:
    folder = tmp_path / "mugs"
    folder.mkdir()
    for name in ("b.obj", "a.obj", "c.stl.txt", ".hidden.obj"):
        tetrahedron(folder / name)
    made = world(tmp_path, objects={"mug": {"source": {"folder": "mugs", "pattern": "*.obj", "scale": 2}}})
    assert [(e.name, e.source) for e in made.entities] == [("mug~0", "mugs/a.obj"), ("mug~1", "mugs/b.obj")]
    assert EntityShape(made, "mug~0").bounds(np.array([0, 0, 0, 0, 0, 0, 1.0]))[1].max() == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("pattern", "wanted"),
    [
        ("*", ["a.obj"]),
        ("*/model.obj", ["cup/model.obj"]),
        ("c*/m*", ["cup/model.obj"]),
        ("**/*.obj", ["a.obj", "cup/model.obj", "tall/vase/model.obj"]),
        ("**/vase/*", ["tall/vase/model.obj"]),
        ("**/**/m*", ["cup/model.obj", "tall/vase/model.obj"]),
    ],
)
def test_a_pattern_may_go_into_folders(world: Make, tmp_path: Path, pattern: str, wanted: list[str]) -> None:
    for name in ("a.obj", "cup/model.obj", "tall/vase/model.obj"):
        (tmp_path / "mugs" / name).parent.mkdir(parents=True, exist_ok=True)
        tetrahedron(tmp_path / "mugs" / name)
    made = world(tmp_path, objects={"mug": {"source": {"folder": "mugs", "pattern": pattern}}})
    assert [e.source for e in made.entities] == [f"mugs/{name}" for name in wanted]


def test_a_folder_that_is_a_whole_disk_is_refused(world: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "mugs" / "deep").mkdir(parents=True)
    for name in "abc":
        tetrahedron(tmp_path / "mugs" / "deep" / f"{name}.obj")
    monkeypatch.setattr(variants, "FOLDER_ENTRIES", variants.FOLDER_ENTRIES._replace(value=3))
    told = messages(world, tmp_path, objects={"mug": {"source": {"folder": "mugs", "pattern": "**/*.none"}}})
    assert "objects.mug.source: folder 'mugs': has more than 3 entries; the limit of a folder of sources" in told
    assert told.endswith("name a folder further down")


def test_folders_that_cannot_be_used(world: Make, tmp_path: Path) -> None:
    inside = tmp_path / "inside"
    (inside / "mugs").mkdir(parents=True)
    (tmp_path / "secret").mkdir()
    tetrahedron(tmp_path / "secret" / "x.obj")
    (inside / "mugs" / "readme.md").write_text("")
    find = lambda folder, pattern="*.obj": messages(  # noqa: E731
        world, inside, objects={"mug": {"source": {"folder": folder, "pattern": pattern}}}
    )
    assert "world" not in find("mugs")
    assert "objects.mug.source: folder 'mugs' has no file that fits '*.obj' (it has: readme.md)" in find("mugs")
    assert "folder 'mgs' does not exist" in find("mgs")
    assert "leaves its root" in find("../secret")
    (inside / "mugs" / "link.obj").symlink_to(tmp_path / "secret" / "x.obj")
    assert "leaves its root" in find("mugs")


def test_errors_name_the_source_at_fault(world: Make, tmp_path: Path) -> None:
    text = messages(world, tmp_path, objects={"mug": {"source": {"choice": [BALL, "none.obj"]}}})
    assert text.startswith("objects.mug.source.choice.1: asset 'none.obj' does not exist")


def test_a_fault_of_all_that_an_object_can_be_is_said_once(world: Make) -> None:
    text = messages(world, objects={"mug": {"source": {"choice": [BALL, BRICK]}, "color": "gren"}})
    assert len(text.splitlines()) == 1


def test_sources_may_mix_families(world: Make, tmp_path: Path) -> None:
    (tmp_path / "chest.urdf").write_text(CHEST)
    made = world(tmp_path, objects={"thing": {"source": {"choice": [BALL, "chest.urdf"]}}})
    assert [(e.family, e.joint_stop - e.joint_start) for e in made.entities] == [("rigid", 0), ("articulation", 1)]
    assert [j.name for j in made.joints] == ["thing~1.hinge"]


def test_a_family_is_checked_against_the_source(world: Make, tmp_path: Path) -> None:
    (tmp_path / "chest.urdf").write_text(CHEST)
    chest = {"source": "chest.urdf"}
    rigid = messages(world, tmp_path, objects={"a": {**chest, "family": "rigid"}})
    assert "objects.a.family: 'chest.urdf' has 1 joints (hinge), so it is an articulation, not `rigid`" in rigid
    assert "has no joints" in messages(world, objects={"a": {"source": BALL, "family": "articulation"}})
    many = messages(world, tmp_path, objects={"a": {**chest, "family": "rigid_instancer", "count": 2}})
    assert "not `rigid_instancer`" in many
    assert world(tmp_path, objects={"a": {**chest, "family": "articulation"}}).entities[0].family == "articulation"


def test_an_instance_cannot_have_the_name_of_another_object(world: Make) -> None:
    text = messages(world, objects={"cube": {"source": BALL, "count": 2}, "cube_1": {"source": BALL}})
    assert text.startswith("objects.cube.count: the 2 instances of 'cube' are called cube_0, cube_1, but cube_1 is")


def test_too_many_things_to_build_are_refused(world: Make) -> None:
    choice = [{"sphere": 0.01 * (k + 1)} for k in range(40)]
    text = messages(world, objects={"a": {"source": {"choice": choice}, "scale": {"range": [1, 2]}, "sizes": 64}})
    assert "40 sources in 64 sizes are 2560 things to build" in text


def test_groups_sensors_and_cameras_take_logical_names(world: Make) -> None:
    made = world(
        objects={"mug": {"source": {"choice": [BALL, BRICK]}}, "cube": {"source": BALL, "count": {"range": [0, 2]}}},
        collisions={"exclude": [["mug", "cube"], ["cube", "cube"]]},
        contact_sensors={"s": {"body": "mug", "against": "cube"}},
        cameras={"c": {"from": [1, 1, 1], "look_at": "mug"}},
    )
    assert made.excluded_pairs == {(0, 2), (0, 3), (1, 2), (1, 3), (2, 3)}
    assert (made.contact_sensors[0].bodies, made.contact_sensors[0].against) == ((0, 1), (2, 3))
    assert made.cameras[0].look_at == "mug"
    assert Index(made).segmentation_ids("cube") == (3, 4)


def test_names_that_stand_for_several_are_refused_where_one_is_needed(world: Make) -> None:
    objects = {"mug": {"source": {"choice": [BALL, BRICK]}}, "cube": {"source": BALL, "count": 2}}
    look = messages(world, objects=objects, cameras={"c": {"from": [1, 1, 1], "look_at": "cube"}})
    assert "cameras.c.look_at: there are 2 of 'cube'; look at one of them: cube_0, cube_1" in look
    mount = messages(world, objects=objects, cameras={"c": {"mount": "mug"}})
    assert "cameras.c.mount: 'mug' can be 2 entities; name one of them: mug~0, mug~1" in mount
    with pytest.raises(NameLookupError, match=r"'mug' stands for 2 entities .* mug~0, mug~1"):
        Index(world(objects=objects)).entity("mug")


def test_a_frame_must_be_on_all_that_an_object_can_be(world: Make, tmp_path: Path) -> None:
    (tmp_path / "chest.urdf").write_text(CHEST)
    made = world(tmp_path, objects={"a": {"source": "chest.urdf", "scale": {"choice": [1, 2]}}})
    ((slot, frames),) = frames_of(made, "a.handle")
    assert (slot.name, [f.position[0] for f in frames]) == ("a", [0.1, 0.2])
    mixed = world(tmp_path, objects={"a": {"source": {"choice": ["chest.urdf", BALL]}}})
    with pytest.raises(NameLookupError, match=r"'a.handle' is not there in all that 'a' can be: a~1 has no such frame"):
        frames_of(mixed, "a.handle")


def test_an_entity_that_varies_can_be_removed(world: Make) -> None:
    objects = {
        "mug": {"source": {"choice": [BALL, BRICK], "otherwise": BRICK, "ratio": 0.5}},
        "cube": {"source": BALL, "count": {"range": [0, 2]}},
    }
    made = world(objects=objects, cameras={"c": {"from": [1, 1, 1], "look_at": "mug"}})
    assert names(without_entity(made, "mug")) == ["cube_0", "cube_1"]
    assert without_entity(made, "mug~0").cameras[0].look_at == "mug"
    assert without_entity(made, "mug").cameras[0].look_at is None


def test_the_hash_says_what_can_be(world: Make) -> None:
    make = lambda **spec: world(objects={"a": {"source": {"choice": [BALL, BRICK]}, **spec}})  # noqa: E731
    assert make().hash == make().hash
    assert (
        len({make().hash, make(scale={"choice": [1, 2]}).hash, make(count=1).hash, make(count={"range": [0, 1]}).hash})
        == 4
    )


# ---------------------------------------------------------------------- instancers


def grains(make: Make, count: int = 100, **more: Any) -> World:
    layout = more.pop("layout", {})
    spec = {"source": {"sphere": 0.01}, "family": "rigid_instancer", "count": count, **more}
    return make(objects={"table": {"source": {"box": [1, 1, 0.5]}, "fixed": True}, "grains": spec}, layout=layout)


def test_an_instancer_is_one_entity_of_many_bodies(world: Make) -> None:
    made = grains(world)
    assert names(made) == ["table", "grains"]
    entity = made.entities[1]
    assert (entity.family, entity.body_stop - entity.body_start, made.slots) == ("rigid_instancer", 100, ())
    assert [b.name for b in made.bodies[1:4]] == ["grains.0", "grains.1", "grains.2"]
    assert {b.kind for b in made.bodies[1:]} == {"free"}
    assert Index(made).geom("grains.99.shape") == len(made.geoms) - 1


def test_instances_stand_on_a_grid_around_the_first(world: Make) -> None:
    made = grains(world, layout={"table": {"position": [0, 0, 0.25]}, "grains": {"on": "table", "x": 0.3}})
    places = made.initial_body_pose[1:, :3]
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1) + np.eye(100)
    assert apart.min() == pytest.approx(0.022)  # diameter and a tenth
    assert places[:, 2].min() == pytest.approx(0.51)
    assert places[0].tolist() == pytest.approx([0.3, 0.0, 0.51])
    flat = grains(world, grid=[10, 10], gap=0.01).initial_body_pose[1:, :3]
    assert np.unique(flat[:, 2].round(9)).size == 1
    assert np.ptp(flat[:, 0]) == pytest.approx(9 * 0.03)


@pytest.mark.parametrize("columns", [(1 << 70, 2), (2, 1 << 70), (1 << 70, 1 << 70), (1 << 20, 1 << 20), (1, 10**250)])
def test_columns_that_no_instance_stands_in_cost_nothing(world: Make, columns: tuple[int, int]) -> None:
    """They stand as in the smallest layer that has room for as many in its middle."""
    few = tuple(number if number < 200 else 200 + number % 2 for number in columns)
    assert np.array_equal(grid(100, np.ones(3), columns), grid(100, np.ones(3), (few[0], few[1])))
    assert len(grains(world, grid=list(columns)).bodies) == 101


def test_the_layers_of_a_grid_are_filled_from_the_middle() -> None:
    """Against all columns in the order of their distance."""
    for nx, ny in product((1, 2, 3, 7, 30), (1, 2, 5, 30)):
        x, y = np.meshgrid(np.arange(nx) - nx // 2, np.arange(ny) - ny // 2, indexing="ij")
        near = np.argsort((x**2 + y**2).ravel(), kind="stable")
        for count in (1, 3, 40, 100):
            layer, number = np.divmod(np.arange(count), nx * ny)
            aside = 0.25 * (layer % 2)
            wanted = np.stack([x.ravel()[near[number]] + aside, y.ravel()[near[number]] + aside, layer], axis=1)
            assert np.array_equal(grid(count, np.ones(3), (nx, ny)), wanted)


def test_an_instancer_can_have_several_sources(world: Make) -> None:
    made = grains(world, 5, source={"choice": [{"sphere": 0.01}, {"box": [0.01, 0.01, 0.01]}]})
    assert names(made) == ["table", "grains~0", "grains~1"]
    assert made.slots[0].entities == (1, 2)
    assert made.bodies[-1].name == "grains~1.4"


def test_what_many_ask_for_grows_with_their_number(world: Make) -> None:
    """Of 2,000 balls that stand still, and a brick: no table of all pairs, which has 4 MB for each of its sums."""
    balls = {"source": BALL, "count": 2000, "family": "rigid_instancer", "fixed": True}
    made = world(objects={"balls": balls, "brick": {"source": BRICK}})
    tracemalloc.start()
    try:
        needs = needs_of(made)
        excluded = with_exclusions(made, CollisionsSpec(exclude=(("balls", "brick"),)), Issues()).excluded_pairs
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert "geom 'brick.shape' collides with 'terrain'" in [need.why for need in needs]
    assert len(excluded) == 2000
    assert peak < 4e6


def test_which_of_some_may_meet_which_of_others(world: Make) -> None:
    objects = {"pair": {"source": {"choice": [BALL, BRICK]}}, "wall": {"source": BRICK, "fixed": True}}
    made = world(objects=objects | {"ball": {"source": BALL, "count": 3}}, collisions={"exclude": [["ball_0", "wall"]]})
    bodies = np.arange(-1, len(made.bodies))
    whole = may_meet(made, bodies)
    assert 0 < whole.sum() < whole.size
    for some, others in (([3, 1, -1], [0, 2]), ([5], bodies), (bodies[::-1], [4, 4])):
        found = may_meet(made, np.array(some), np.array(others))
        assert (found == whole[np.ix_(np.array(some) + 1, np.array(others) + 1)]).all()
