"""Draws of an object's matter are written to the engine, noted by name, and are the same on every path."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.api import compile_world, load
from anysim.errors import AssetError, SpecError
from anysim.managers.object_parameters import SceneManager
from anysim.model.world import Slot
from anysim.randomization.streams import Streams
from anysim.testing.kinematic import NullEngine
from anysim_inspect.draws import explain
from tests.task.helpers import BLOCKS

DRAWN: dict[str, Any] = {
    "source": {"box": [0.05, 0.05, 0.05]},
    "mass": {"range": [0.1, 0.4]},
    "inertia_scale": {"range": [0.5, 2.0]},
    "com_offset": {"range": [[-0.01, 0.0, 0.0], [0.01, 0.0, 0.02]]},
    "friction": {"range": [0.2, 0.8]},
    "restitution": {"range": [0.1, 0.6]},
    "damping": {"linear": {"range": [0.1, 1.0]}, "angular": {"choice": [0.0, 0.5]}},
    "texture": {"choice": ["checker", {"pattern": "noise", "seed": 4}], "weights": [1, 1]},
    "material": {"choice": ["metal", "glass", {"preset": "rubber", "roughness": 0.5}]},
}


def _make(num_envs: int = 8, engine: str = "null", **red: Any):
    tree = {**BLOCKS, "world": {**BLOCKS["world"], "objects": {**BLOCKS["world"]["objects"], "red": {**DRAWN, **red}}}}
    return anysim.make(tree, num_envs=num_envs, engine=engine)


@pytest.mark.parametrize("engine", ["null", "mujoco", "pybullet", "sapien"])
def test_every_field_is_drawn_written_and_noted(engine: str) -> None:
    with _make(engine=engine) as env:
        env.reset(seed=3)
        world, sim, draws = env.engine.world, env.engine, env.streams.draws
        body, entity = sim.index.body("red"), sim.index.entity("red")
        geoms = sim.index.geoms_of(entity)
        read = {n: sim.get_parameters(n, indices=[body])[:, 0] for n in sim.parameters if n.startswith("body.")}
        look = {n: sim.get_parameters(n, indices=geoms)[:, 0] for n in sim.parameters if n.startswith("geom.")}
        drawn = {
            key: [d[f"scene/red/{key}"] for d in draws]
            for key in (
                "mass",
                "inertia_scale",
                "com_offset",
                "friction",
                "restitution",
                "damping.linear",
                "damping.angular",
                "texture",
                "material",
            )
        }
        assert np.allclose(read["body.mass"], drawn["mass"], rtol=1e-5)
        moments = np.array(drawn["mass"]) * np.array(drawn["inertia_scale"]) * 0.05**2 / 6
        assert np.allclose(read["body.inertia"][:, 0], moments, rtol=1e-5)
        assert np.allclose(read["body.com"], drawn["com_offset"], atol=1e-8)
        assert np.allclose(read["body.linear_damping"], drawn["damping.linear"], rtol=1e-5)
        assert np.allclose(read["body.angular_damping"], drawn["damping.angular"], rtol=1e-5)
        assert np.allclose(look["geom.friction"], drawn["friction"], rtol=1e-5)
        assert np.allclose(look["geom.restitution"], drawn["restitution"], rtol=1e-5)
        assert [world.textures[int(i)].name for i in look["geom.texture"]] == drawn["texture"]
        assert [world.materials[int(i)].name for i in look["geom.material"]] == drawn["material"]
        opacity = {m.name: m.opacity for m in world.materials}
        assert np.allclose(look["geom.color"][:, 3], [opacity[m] for m in drawn["material"]])
        assert np.allclose(look["geom.color"][:, :3], 1.0)  # a texture shows its own colours
        assert len(set(drawn["texture"])) == 2
        assert len(set(drawn["mass"])) == 8


def test_a_drawn_material_brings_its_colour_unless_there_is_one() -> None:
    with _make(texture="checker") as painted, _make(**{"texture": None}) as bare, _make(color="red") as red:
        for env in (painted, bare, red):
            env.reset(seed=1)
        geoms = bare.engine.index.geoms_of(bare.engine.index.entity("red"))
        colors = {m.name: m.color for m in bare.engine.world.materials}
        wanted = [colors[d["scene/red/material"]] for d in bare.streams.draws]
        assert np.allclose(bare.engine.get_parameters("geom.color", indices=geoms)[:, 0, :3], wanted)
        assert np.allclose(red.engine.get_parameters("geom.color", indices=geoms)[:, 0, :3], [1.0, 0.0, 0.0])
        assert np.allclose(painted.engine.get_parameters("geom.color", indices=geoms)[:, 0, :3], 1.0)


def test_an_env_draws_the_same_whatever_the_number_of_envs() -> None:
    with _make(2) as few, _make(5) as many:
        few.reset(seed=9)
        many.reset(seed=9)
        assert few.streams.draws == many.streams.draws[:2]


def test_explain_says_where_textures_and_damping_come_from() -> None:
    tree = {**BLOCKS, "world": {**BLOCKS["world"], "objects": {**BLOCKS["world"]["objects"], "red": DRAWN}}}
    found = {draw.name: draw for draw in explain(tree, seed=3).draws}
    assert found["scene/red/texture"].path == "world.objects.red.texture"
    assert found["scene/red/texture"].value in ("checker", "noise-" + found["scene/red/texture"].value[-8:])
    assert found["scene/red/damping.linear"].path == "world.objects.red.damping.linear"


def test_what_is_drawn_goes_to_the_entity_that_is_there() -> None:
    """Two entities of one slot: each env writes to the one it has, and nothing where there is none."""
    loaded = load(BLOCKS)
    world = compile_world(loaded)
    names = [entity.name for entity in world.entities]
    both = (names.index("red"), names.index("ball"))
    world = replace(world, slots=(Slot("red", "red", 0, both),))
    streams, manager = Streams(3), SceneManager()
    manager.configure(loaded.spec, streams)
    manager.build(world)
    with NullEngine() as engine:
        engine.create_world(world, 3)
        rows = np.ones((3, len(names)), dtype=bool)
        rows[0, both[1]] = rows[1, both[0]] = False
        rows[2, list(both)] = False
        engine.reset(present=rows)
        manager.bind(engine)
        streams.seed(0, np.arange(3))
        streams.begin(np.arange(3))
        before = engine.get_parameters("body.mass")
        manager.reset(np.arange(3))
        mass = engine.get_parameters("body.mass")
        red, ball = engine.index.body("red"), engine.index.body("ball")
        assert mass[0, red] == pytest.approx(streams.draws[0]["scene/red/mass"])
        assert mass[1, ball] == pytest.approx(streams.draws[1]["scene/red/mass"])
        assert mass[0, ball] == before[0, ball]
        assert mass[1, red] == before[1, red]
        assert np.array_equal(mass[2], before[2])
        assert streams.draws[2] == {}


@pytest.mark.parametrize(
    ("fields", "where", "words"),
    [
        ({"damping": {"linear": 1.0}, "fixed": True}, "world.objects.red.damping", "it is fixed"),
        ({"texture": {"pattern": "checker", "colors": ["red", "rde"]}}, "texture.colors", "there is no colour 'rde'"),
        ({"texture": "nothing.png"}, "texture.image", "nothing.png"),
        ({"texture": {"repeat": 2}}, "texture", "expected either pattern or image; got none"),
        ({"restitution": {"range": [0.5, 1.0]}}, "restitution", "1"),
        ({"solver": {"position_iterations": 0}}, "solver.position_iterations", "at least 1"),
    ],
)
def test_what_cannot_be_is_refused_by_its_key(fields: dict[str, Any], where: str, words: str, tmp_path) -> None:
    red = {"source": {"box": [0.1, 0.1, 0.1]}, **fields}
    tree = {"world": {"objects": {"red": red}, "layout": {"red": {"position": [0, 0, 1]}}}}
    with pytest.raises((SpecError, AssetError)) as caught:
        compile_world(load(tree), base=tmp_path)
    assert where in str(caught.value)
    assert words in str(caught.value)
