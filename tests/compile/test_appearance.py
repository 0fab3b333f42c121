"""Patterns, images and materials of a spec, and where they lie on a shape."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from anysim import registry
from anysim.api import compile_world, load
from anysim.compile.appearance import material, material_name, texture, texture_name
from anysim.engine.capability import Capability
from anysim.engine.requirements import needs_of
from anysim.errors import AssetError, SpecError
from anysim.geometry.triangles import triangles
from anysim.model.appearance import lying, wrapped
from anysim.model.shapes import Box, Capsule, Cylinder, Sphere
from anysim_schemas.matter import MaterialSpec, TextureSpec


def test_names_follow_from_what_is_given() -> None:
    assert texture_name(TextureSpec.model_validate("checker")) == "checker"
    assert texture_name(TextureSpec(pattern="checker", seed=1)).startswith("checker-")
    assert texture_name(TextureSpec.model_validate("a/floor.png")) == "a/floor.png"
    assert material_name(MaterialSpec.model_validate("metal")) == "metal"
    rough = MaterialSpec(preset="metal", roughness=0.8)
    assert material_name(rough).startswith("metal-")
    assert (material(rough).roughness, material(rough).metallic) == (0.8, 1.0)


def test_an_image_is_found_as_meshes_are(tmp_path: Path) -> None:
    Image.new("RGB", (20, 10), (200, 30, 30)).save(tmp_path / "label.png")
    tree = {"world": {
        "objects": {"box": {"source": {"box": [0.1, 0.1, 0.1]}, "texture": "label.png"}},
        "layout": {"box": {"position": [0, 0, 1]}},
    }}  # fmt: skip
    world = compile_world(load(tree), base=tmp_path)
    found = world.textures[0]
    assert found.pixels.shape == (20, 20, 3)
    assert np.abs(found.pixels.astype(int) - [200, 30, 30]).max() <= 1
    assert world.geom_texture[world.geoms.index(next(g for g in world.geoms if g.texture))] == 0
    (tmp_path / "text.png").write_text("no image")
    with pytest.raises(AssetError, match=r"text\.png: cannot be read"):
        texture(TextureSpec(image="text.png"), tmp_path)
    with pytest.raises(AssetError, match=r"label\.png"):
        texture(TextureSpec(image="../label.png"), tmp_path / "inner")


def test_what_may_be_drawn_is_in_the_world_once() -> None:
    box = {"source": {"box": [0.1, 0.1, 0.1]}, "texture": {"choice": ["brick", "noise"]}}
    other = {"source": {"sphere": 0.1}, "texture": "noise", "material": "metal"}
    tree = {"world": {
        "objects": {"a": box, "b": other}, "layout": {"a": {"position": [0, 0, 1]}, "b": {"position": [1, 0, 1]}},
        "cameras": {"front": {"from": [3, 0, 1], "look_at": "a"}},
    }}  # fmt: skip
    world = compile_world(load(tree))
    assert [t.name for t in world.textures] == ["brick", "noise"]
    assert {g.name: g.texture for g in world.geoms if g.texture} == {"a.shape": "brick", "b.shape": "noise"}
    assert {g.name: g.material for g in world.geoms if g.material} == {"b.shape": "metal"}
    needed = {need.capability for need in needs_of(world)}
    assert {Capability.TEXTURES, Capability.MATERIALS} <= needed
    again = compile_world(load(tree))
    assert again.hash == world.hash
    tree["world"]["objects"]["b"]["texture"] = {"pattern": "noise", "seed": 1}
    assert compile_world(load(tree)).hash != world.hash


def test_a_pattern_needs_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    installed = registry._entries
    monkeypatch.setattr(registry, "_entries", lambda kind: {} if kind == "textures" else installed(kind))
    box = {"source": {"box": [0.1, 0.1, 0.1]}, "texture": {"choice": ["brick", {"pattern": "noise", "seed": 1}]}}
    with pytest.raises(SpecError, match=r"no texture named 'noise' .* pip install anysim-assets") as caught:
        compile_world(load({"world": {"objects": {"box": box}, "layout": {"box": {"position": [0, 0, 1]}}}}))
    where = "world.objects.box.texture.choice"
    assert [issue.path for issue in caught.value.issues] == [f"{where}.0.pattern", f"{where}.1.pattern"]


@pytest.mark.parametrize("shape", [Box((1.0, 2.0, 3.0)), Sphere(0.5), Capsule(0.2, 0.5), Cylinder(0.3, 0.4)])
def test_triangles_look_outwards_and_close(shape) -> None:
    made = triangles(shape)
    assert made is not None
    corners = made[0][made[1]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    real = np.linalg.norm(normals, axis=1) > 1e-12
    assert ((normals * corners.mean(axis=1)).sum(axis=1)[real] > 0).all()
    volume = np.linalg.det(corners).sum() / 6
    solid = {
        Box: 48.0,
        Sphere: 4 / 3 * np.pi * 0.125,
        Capsule: np.pi * 0.04 * (1.0 + 4 / 3 * 0.2),
        Cylinder: np.pi * 0.09 * 0.8,
    }[type(shape)]
    assert volume == pytest.approx(solid, rel=0.03)


def test_a_texture_covers_each_side_of_a_box_once_and_upright() -> None:
    vertices, faces = triangles(Box((0.1, 0.2, 0.3)))  # type: ignore[misc]
    corners = vertices[faces]
    places = wrapped(corners)
    assert places.min() == 0.0
    assert places.max() == 1.0
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    front = normals[:, 1] < -1e-9
    assert np.array_equal(places[front][..., 1], (corners[front][..., 2] > 0).astype(float)), "the top is up"
    assert np.array_equal(places[front][..., 0], (corners[front][..., 0] > 0).astype(float)), "seen from outside"
    assert lying(corners).min() >= 0.0
