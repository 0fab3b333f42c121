"""Loading: files, merging, extends, overrides, provenance."""

from pathlib import Path

import pytest
from pydantic import BaseModel

from anysim_schemas.errors import SpecError
from anysim_schemas.load import load, load_run
from anysim_schemas.robot_model import RobotModelSpec
from anysim_schemas.run import RunSpec
from anysim_schemas.values import Choice, Normal, Range

GOOD = Path(__file__).parent / "good"
CUBE = "world: {objects: {cube: {source: {sphere: 1}, mass: 2}}}"


def issues(*sources, **options):
    with pytest.raises(SpecError) as caught:
        load_run(list(sources), **options)
    return [str(issue) for issue in caught.value.issues]


def test_a_whole_run_loads(resolver):
    loaded = load_run(GOOD / "pick.yaml", resolver=resolver)
    spec = loaded.spec
    assert spec.engine.name == "mujoco"
    assert spec.engine.options == {"solver": "cg"}
    assert spec.physics.substeps == 10
    cube = spec.world.objects["cube"]
    assert isinstance(cube.mass, Range)
    assert cube.mass.range == (0.05, 0.2)
    assert isinstance(cube.friction, Normal)
    assert cube.friction.normal.low == 0.2
    assert isinstance(cube.color, Choice)
    assert cube.color.choice == ("red", "green", (0.0, 0.0, 1.0))
    assert spec.world.cameras["front"].from_ == (1.4, 0.0, 1.1)
    assert spec.world.objects["mug"].source.mesh == "meshes/mug.stl"
    task = spec.task
    assert task is not None
    assert task.expert is not None
    assert task.success["near"].params == {"object": "cube", "tolerance": 0.025}
    assert task.success["at_rest"].term == "at_rest"
    assert task.events["nudge"].when == "step"
    assert task.expert.params == {"object": "cube"}
    assert [path.name for path in loaded.files] == ["tabletop.yaml", "pick.yaml"]


def test_what_a_spec_writes_it_reads():
    spec = load_run(GOOD / "pick.yaml").spec
    again = load_run(spec.to_dict())
    assert again.spec == spec
    assert again.data == spec.to_dict()


def test_a_robot_loads_from_its_own_root():
    spec = load(RobotModelSpec, GOOD / "arm.yaml").spec
    assert spec.channels["arm"].joints == ("shoulder", "elbow")
    assert spec.surfaces[0].contact.preset == "pad"


def test_the_key_on_stays_text(write):
    write(a="world: {objects: {c: {source: {sphere: 1}}}, layout: {c: {on: terrain, x: 1e-1}}}")
    placement = load_run("a.yaml").spec.world.layout["c"]
    assert placement.on == "terrain"
    assert placement.x == 0.1


def test_files_are_merged_in_order(write):
    write(
        base="num_envs: 1\nphysics: {dt: 0.001, gravity: [0, 0, -1]}\n" + CUBE,
        over="num_envs: 2\nphysics: {gravity: [0, 0, -2]}\n"
        "world: {objects: {cube: {mass: 3}, ball: {source: {sphere: 2}}}}",
        top="num_envs: 3",
    )
    spec = load_run(["base.yaml", "over.yaml", "top.yaml"]).spec
    assert spec.num_envs == 3
    assert spec.physics.dt == 0.001
    assert spec.physics.gravity == (0, 0, -2)
    assert spec.world.objects["cube"].mass == 3
    assert set(spec.world.objects) == {"cube", "ball"}


def test_null_removes_what_is_inherited_and_stays_where_nothing_is(write):
    write(base=CUBE + "\nseed: 4\ntask: {observations: {policy: [a]}, success: {near: {x: 1}}}")
    write(over="world: {objects: {cube: null}}\nseed:\ntask: {success: {near: , still: }}")
    loaded = load_run(["base.yaml", "over.yaml"])
    assert loaded.spec.world.objects == {}
    assert loaded.spec.seed == 0
    assert loaded.spec.task is not None
    assert list(loaded.spec.task.success) == ["still"]
    assert "seed" not in loaded.data


NORMAL = {"normal": {"mean": 1, "std": 1}}
CHOICE = {"choice": [1], "weights": [1]}


@pytest.mark.parametrize(
    ("base", "over", "merged"),
    [
        ({"source": {"box": [1, 1, 1]}}, {"source": {"mesh": "a.stl"}}, {"source": {"mesh": "a.stl"}}),
        ({"source": "a.urdf"}, {"source": {"scale": 2}}, {"source": {"asset": "a.urdf", "scale": 2}}),
        ({"source": {"mesh": "a.stl"}}, {"source": "b.urdf"}, {"source": "b.urdf"}),
        ({"source": "a", "mass": 1}, {"density": 5}, {"source": "a", "density": 5}),
        ({"source": "a", "mass": {"range": [1, 2]}}, {"mass": NORMAL}, {"source": "a", "mass": NORMAL}),
        ({"source": "a", "mass": {"range": [1, 2]}}, {"mass": CHOICE}, {"source": "a", "mass": CHOICE}),
        ({"source": "a", "mass": CHOICE}, {"mass": NORMAL}, {"source": "a", "mass": NORMAL}),
        (
            {"source": "a", "mass": CHOICE},
            {"mass": {"weights": [5]}},
            {"source": "a", "mass": {**CHOICE, "weights": [5]}},
        ),
        ({"source": "a", "mass": 1}, {"mass": CHOICE}, {"source": "a", "mass": CHOICE}),
        ({"source": "a", "mass": 1}, {"density": None}, {"source": "a", "mass": 1, "density": None}),
    ],
)
def test_an_alternative_replaces_the_one_that_is_inherited(base, over, merged):
    data = load_run([{"world": {"objects": {"cube": cube}}} for cube in (base, over)]).data
    assert data["world"]["objects"]["cube"] == merged


def test_an_engine_by_name_takes_options_from_above():
    spec = load_run([{"engine": "mujoco"}, {"engine": {"options": {"x": 1}}}]).spec
    assert (spec.engine.name, spec.engine.options) == ("mujoco", {"x": 1})
    spec = load_run([{"engine": {"name": "mujoco", "options": {"x": 1}}}, {"engine": "other"}]).spec
    assert (spec.engine.name, spec.engine.options) == ("other", {})


def test_another_engine_by_name_keeps_the_shards():
    """Options belong to the engine that is replaced; how many processes run it does not."""
    base = {"engine": {"name": "mujoco", "options": {"x": 1}, "shards": 4, "shard_timeout": 9.0}}
    spec = load_run([base, {"engine": "other"}]).spec
    assert (spec.engine.name, spec.engine.options) == ("other", {})
    assert (spec.engine.shards, spec.engine.shard_timeout) == (4, 9.0)
    for overrides in (["engine.shards=auto", "engine=other"], ["engine=other", "engine.shards=auto"]):
        spec = load_run([base], overrides=overrides).spec
        assert (spec.engine.name, spec.engine.options, spec.engine.shards) == ("other", {}, "auto")
    assert load_run([{"engine": "mujoco"}, {"engine": "other"}]).spec.engine.shards == 1


@pytest.mark.parametrize("shards", [0, -1, 1.5, "many"])
def test_shards_are_a_number_or_auto(shards):
    with pytest.raises(SpecError, match=r"engine\.shards"):
        load_run({"engine": {"name": "mujoco", "shards": shards}})


def test_base_data_lies_beneath_everything(write):
    write(a="num_envs: 2")
    spec = load_run("a.yaml", base_data={"engine": "other", "num_envs": 7}).spec
    assert spec.engine.name == "other"
    assert spec.num_envs == 2
    assert load_run([], base_data={"seed": 3}).spec.seed == 3


def test_extends_is_relative_to_the_file_that_says_it(write, tmp_path):
    (tmp_path / "deep" / "er").mkdir(parents=True)
    (tmp_path / "deep" / "base.yaml").write_text("seed: 1\nnum_envs: 5")
    (tmp_path / "deep" / "er" / "mid.yaml").write_text("extends: ../base.yaml\nseed: 2")
    write(other="physics: {dt: 0.01}", top="extends: [other.yaml, deep/er/mid.yaml]\nengine: x")
    loaded = load_run("top.yaml")
    assert (loaded.spec.seed, loaded.spec.num_envs, loaded.spec.physics.dt) == (2, 5, 0.01)
    assert [str(path) for path in loaded.files] == [
        "other.yaml",
        "deep/er/../base.yaml",
        "deep/er/mid.yaml",
        "top.yaml",
    ]
    assert loaded.where("num_envs") == "deep/base.yaml:2:11"
    assert "extends" not in loaded.data


def test_one_base_may_be_extended_twice(write):
    write(base="seed: 1", a="extends: base.yaml\nnum_envs: 2", b="extends: base.yaml", top="extends: [a.yaml, b.yaml]")
    loaded = load_run("top.yaml")
    assert loaded.spec.num_envs == 2
    assert [path.name for path in loaded.files] == ["base.yaml", "a.yaml", "b.yaml", "top.yaml"]


def test_extends_looks_names_up(write, tmp_path):
    write(base="seed: 5", top="extends: shelf:base", lost="extends: shelf:other")

    def shelf(uri: str) -> Path:
        if uri != "shelf:base":
            raise LookupError(f"no {uri} on the shelf")
        return tmp_path / "base.yaml"

    loaded = load_run("top.yaml", extends=shelf)
    assert loaded.spec.seed == 5
    assert loaded.where("seed") == "base.yaml:1:7"
    assert issues("lost.yaml", extends=shelf) == [
        "lost.yaml:1:10: extends: 'shelf:other' cannot be looked up: no shelf:other on the shelf"
    ]


def test_a_cycle_shows_the_chain(write):
    write(a="extends: b.yaml", b="seed: 1\nextends: [c.yaml]", c="extends: b.yaml", alone="extends: alone.yaml")
    assert issues("a.yaml") == ["c.yaml:1:10: extends: the file extends itself: b.yaml → c.yaml → b.yaml"]
    assert issues("alone.yaml") == ["alone.yaml:1:10: extends: the file extends itself: alone.yaml → alone.yaml"]


def test_a_missing_file_is_named_with_the_file_that_refers_to_it(write):
    write(tabletop="seed: 1", a="extends: tabletp.yaml")
    assert issues("a.yaml") == [
        "a.yaml:1:10: extends: the file 'tabletp.yaml' that it extends does not exist; did you mean 'tabletop.yaml'?"
    ]
    assert issues("tabeltop.yaml") == ["tabeltop.yaml: it does not exist; did you mean 'tabletop.yaml'?"]


def test_files_that_are_no_text(write, tmp_path):
    write()
    (tmp_path / "latin.yaml").write_bytes(b"seed: 1 # caf\xe9")
    (tmp_path / "folder.yaml").mkdir()
    (tmp_path / "bom.yaml").write_bytes(b"\xef\xbb\xbfseed: 1\r\nnum_envs: 0\r\n")
    assert issues("latin.yaml") == ["latin.yaml: it is not UTF-8 text: byte 13 is 0xe9"]
    assert issues("folder.yaml") == ["folder.yaml: it is a directory, not a file"]
    assert issues("bom.yaml")[0].startswith("bom.yaml:2:11: num_envs: must be greater than 0, got 0")


def test_private_root_keys_are_dropped(write):
    write(a="_cube: &cube {source: {sphere: 1}}\nworld: {objects: {a: *cube, b: {<<: *cube, mass: 1}}}")
    loaded = load_run("a.yaml")
    assert set(loaded.spec.world.objects) == {"a", "b"}
    assert set(loaded.data) == {"world"}


def test_files_are_shown_as_they_were_given(write, tmp_path):
    write(a="sede: 1")
    (tmp_path / "sub").mkdir()
    for given in ("a.yaml", "sub/../a.yaml", tmp_path / "a.yaml", Path("./a.yaml")):
        assert issues(given)[0].startswith("a.yaml:1:1: sede: unknown key; did you mean 'seed'?")


@pytest.mark.parametrize(
    ("override", "path", "value"),
    [
        ("physics.dt=0.004", "physics.dt", 0.004),
        ("physics.dt=1e-3", "physics.dt", 1e-3),
        ("physics.gravity.2=-1.6", "physics.gravity", [0, 0, -1.6]),
        ("physics.gravity=[0, 0, 1]", "physics.gravity", [0, 0, 1]),
        ("world.objects.cube.mass={range: [1, 2]}", "world.objects.cube.mass", {"range": [1, 2]}),
        ("world.objects.cube.density=5", "world.objects.cube", {"source": {"sphere": 1}, "density": 5}),
        ("world.objects.cube.mass=", "world.objects.cube", {"source": {"sphere": 1}}),
        ("world.objects.cube=null", "world.objects", {}),
        ("engine.name=other", "engine", {"name": "other"}),
        ("engine.options.x=true", "engine", {"name": "mujoco", "options": {"x": True}}),
        ("engine=other", "engine", "other"),
        ("world.terrain.friction=0.5", "world.terrain", {"friction": 0.5}),
        ("task.observations.policy.1.scale=2", "task.observations.policy", ["a", {"term": "b", "scale": 2}]),
        ("world.name=a=b", "world.name", "a=b"),
        ("task.success.near.tolerance=0.1", "task.success.near", {"tolerance": 0.1}),
    ],
)
def test_overrides(write, override, path, value):
    write(
        a="physics: {gravity: [0, 0, -1], dt: 0.01, control_dt: 0.02}\nengine: mujoco\n"
        "task: {observations: {policy: [a, {term: b}]}, success: {near: }}\n" + CUBE
    )
    name = f"-o {override}"
    if override == "world.name=a=b":
        assert issues("a.yaml", overrides=[override])[0].startswith(f"{name}: world.name: a name starts with a letter")
        return
    loaded = load_run("a.yaml", overrides=[override])
    found = loaded.data
    for part in path.split("."):
        found = found[part]
    assert found == value
    assert name in {*loaded.provenance.values()} or override.endswith(("=", "=null"))


def test_the_last_override_wins():
    loaded = load_run({}, overrides=iter(["seed=1", "seed=2"]))
    assert loaded.spec.seed == 2
    assert loaded.where("seed") == "-o seed=2"


def test_provenance(write):
    write(
        base=CUBE,
        a="extends: base.yaml\nengine: mujoco\nworld: {objects: {cube: {mass: 3}}}\n"
        "task: {observations: {policy: [a, b]}, success: {near: }}",
    )
    loaded = load_run(["a.yaml", {"num_envs": 2}], overrides=["physics.dt=0.001"])
    places = {
        "world.objects.cube.mass": "a.yaml:3:32",
        "world.objects.cube.source.sphere": "base.yaml:1:43",
        "engine": "a.yaml:2:9",
        "engine.name": "a.yaml:2:9",
        "task.observations.policy.1": "a.yaml:4:35",
        "task.success.near.term": "a.yaml:4:50",
        "physics.dt": "-o physics.dt=0.001",
        "num_envs": "data",
        "seed": "default",
        "physics.gravity.2": "default",
        "world.objects.cube.friction": "default",
    }
    assert {path: loaded.where(path) for path in places} == places
    with pytest.raises(KeyError, match=r"the spec has no 'physics\.dtt'; did you mean 'dt'\?"):
        loaded.where("physics.dtt")


def test_all_errors_come_at_once_in_the_order_of_the_files(write, resolver):
    write(
        base="world:\n  objects:\n    cube: {source: {sphere: -1}, masss: 1}\nseed: -1",
        a="extends: base.yaml\nnum_envs: 0\nengine: {name: mujoco, options: {solver: x}}\nnum_envs: 1\n",
    )
    found = issues("a.yaml", resolver=resolver, overrides=["physics.dt=0"])
    assert [line.split(": ")[0] for line in found] == [
        "base.yaml:3:29",
        "base.yaml:3:34",
        "base.yaml:4:7",
        "a.yaml:2:11",
        "a.yaml:3:42",
        "a.yaml:4:1",
        "-o physics.dt=0",
    ]


def test_two_unreadable_files_are_both_reported(write):
    write(a="x: [", b="y: 'z")
    assert [line.split(":")[0] for line in issues("a.yaml", "b.yaml")] == ["a.yaml", "b.yaml"]


def test_data_without_a_file_has_no_place():
    with pytest.raises(SpecError) as caught:
        load_run({"seed": -1})
    assert str(caught.value).startswith("seed: must be at least 0, got -1")
    assert caught.value.issues[0].where == ""


def test_the_data_is_not_changed():
    data = {"physics": {"dt": 0.01, "control_dt": 0.02}}
    load_run([data, {"physics": {"dt": 0.02}}], overrides=["physics.control_dt=0.04"])
    assert data == {"physics": {"dt": 0.01, "control_dt": 0.02}}


def test_any_model_can_be_a_root():
    class Point(BaseModel):
        x: float
        y: float = 0

    assert load(Point, {"x": 1}).spec == Point(x=1)
    assert load(RunSpec, []).spec == RunSpec()
