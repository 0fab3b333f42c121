"""The ground of a world: heights and meshes from files, and what the ground is below points and rectangles."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from anysim import registry
from anysim.compile.world import compile_world
from anysim.errors import AssetError, CapabilityError, SpecError
from anysim.model.ground import FieldGround, MeshGround
from anysim.model.world import MeshShape, World
from anysim.testing.ground import field_triangles
from anysim_schemas.run import WorldSpec


def made(terrain: Any, base: Path | None = None) -> World:
    return compile_world(WorldSpec.model_validate({"terrain": terrain}), base=base)


# ---------------------------------------------------------------------- files


def test_heights_from_arrays_and_images(tmp_path: Path) -> None:
    from PIL import Image

    rows = np.random.default_rng(0).uniform(0, 1, size=(4, 5))
    np.save(tmp_path / "h.npy", rows)
    np.savez(tmp_path / "h.npz", heights=rows, more=np.zeros(3))
    for name in ("h.npy", "h.npz"):
        assert (made({"kind": "heightfield", "file": name}, tmp_path).heightfields[0].heights == rows).all()
    grey = np.array([[0, 255], [51, 102], [0, 0]], dtype=np.uint8)
    Image.fromarray(grey).save(tmp_path / "h.png")
    field = made({"kind": "heightfield", "file": "h.png", "height_range": [-1, 1]}, tmp_path).heightfields[0]
    # the top row of the picture is the one of highest y
    assert field.heights == pytest.approx(np.array([[-1, -1], [-0.6, -0.2], [-1, 1]]))
    deep = np.array([[0, 65535], [13107, 0]], dtype=np.uint16)
    Image.fromarray(deep).save(tmp_path / "deep.png")
    field = made({"kind": "heightfield", "file": "deep.png", "height_range": [0, 1]}, tmp_path).heightfields[0]
    assert field.heights == pytest.approx(np.array([[0.2, 0], [0, 1]]))


def test_files_that_hold_no_heights_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "objects.npy", np.array([{}, {}], dtype=object), allow_pickle=True)
    np.save(tmp_path / "flat.npy", np.zeros(4))
    np.save(tmp_path / "holes.npy", np.array([[0, np.nan], [0, 0]]))
    np.savez(tmp_path / "two.npz", a=np.zeros((2, 2)), b=np.zeros((2, 2)))
    (tmp_path / "broken.png").write_bytes(b"no picture")
    for file, message in (
        ("objects.npy", "cannot be read as an array"),
        ("flat.npy", "float64 of shape"),
        ("holes.npy", "not finite"),
        ("two.npz", "it has a, b"),
        ("broken.png", "needs `height_range`"),
        ("none.npy", "none.npy"),
        ("../h.npy", "leaves"),
        ("h.txt", "h.txt"),
    ):
        with pytest.raises(AssetError, match=message) as caught:
            made({"kind": "heightfield", "file": file}, tmp_path)
        assert caught.value.issues[0].path == "terrain.file"


def bowl(folder: Path) -> Path:
    """A mesh file of a bumpy square with its middle off the origin."""
    import trimesh

    world = made({"kind": "rough", "size": [4, 3], "cell": 0.25, "difficulty": 1.0, "platform": 0.5})
    vertices, faces = field_triangles(world.heightfields[0])
    path = folder / "ground.stl"
    trimesh.Trimesh(vertices + np.array([1.0, 0.5, 0.2]), faces, process=False).export(path)
    return path


def test_a_mesh_is_ground_of_its_own_or_a_height_field(tmp_path: Path) -> None:
    path = bowl(tmp_path)
    mesh = made({"kind": "trimesh", "file": path.name}, tmp_path)
    assert isinstance(mesh.geoms[0].shape, MeshShape)
    assert mesh.geoms[0].shape.concave
    field = made({"kind": "heightfield", "file": path.name, "cell": 0.25}, tmp_path)
    points = np.random.default_rng(2).uniform((-0.99, -0.99), (2.99, 1.99), size=(500, 2))
    assert field.ground.heights_at(points) == pytest.approx(mesh.ground.heights_at(points), abs=1e-5)
    assert np.isnan(mesh.ground.heights_at(np.array([9.0, 9.0])))
    assert mesh.hash != made({"kind": "trimesh", "file": path.name, "scale": 2.0}, tmp_path).hash


def test_an_engine_without_triangle_meshes_says_what_to_do(tmp_path: Path) -> None:
    from anysim import create_simulation

    world = made({"kind": "trimesh", "file": bowl(tmp_path).name}, tmp_path)
    with pytest.raises(CapabilityError, match="`kind: heightfield` with the same `file`"):
        create_simulation("mujoco").create_world(world)


# ---------------------------------------------------------------------- the ground


def random_field(rng: np.random.Generator) -> tuple[FieldGround, MeshGround]:
    """One relief by the two ways that know nothing of each other."""
    from anysim.model.world import HeightField

    field = HeightField("f", rng.uniform(-1, 1, size=(7, 9)), (4.0, 3.0))
    return FieldGround(field), MeshGround(*field_triangles(field))


def test_fields_and_their_triangles_agree_at_points_and_under_rectangles() -> None:
    rng = np.random.default_rng(0)
    field, mesh = random_field(rng)
    points = rng.uniform((-2, -1.5), (2, 1.5), size=(3000, 2))
    assert field.heights_at(points) == pytest.approx(mesh.heights_at(points), abs=1e-9)
    for _ in range(100):
        a, b = rng.uniform((-2.2, -1.7), (2.2, 1.7), size=(2, 2))
        low, high = np.minimum(a, b), np.maximum(a, b)
        top = field.top_of(low, high)
        assert top == pytest.approx(mesh.top_of(low, high), abs=1e-9)
        inside = rng.uniform(low, high, size=(400, 2))
        assert field.heights_at(inside).max() <= top + 1e-9
        dense = np.stack(np.meshgrid(*np.linspace(low, high, 60).T), axis=-1)
        assert top <= np.max(field.heights_at(dense)) + 0.2 * np.ptp(np.stack([low, high]), axis=0).max()


@pytest.mark.parametrize("terrain", ["stairs", {"kind": "tiles", "tiles": {"rows": 2}}])
def test_generated_ground_needs_its_builder(terrain: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    installed = registry._entries
    monkeypatch.setattr(registry, "_entries", lambda kind: {} if kind == "terrains" else installed(kind))
    with pytest.raises(SpecError, match=r"anysim-assets: pip install anysim-assets") as caught:
        made(terrain)
    assert [issue.path for issue in caught.value.issues] == ["terrain.kind"]
    assert made("plane").geoms
