"""Mesh files: units, axes, colours, hulls, budgets, and hashes that do not depend on the cache."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from anysim import cache
from anysim.assets import meshes
from anysim.compile.edit import with_object, with_robot
from anysim.compile.world import compile_world
from anysim.errors import AssetError
from anysim.geometry.triangles import convex_hull
from anysim_schemas.run import WorldSpec


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(cache.CACHE_ENV, str(tmp_path / "cache"))
    return tmp_path


def write(path: Path, mesh: trimesh.Trimesh) -> Path:
    if path.suffix == ".gltf":
        for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(mesh)).items():
            (path if name == "model.gltf" else path.parent / name).write_bytes(data)
    elif path.suffix == ".3mf":  # whose unit is the millimetre
        mesh.copy().apply_scale(1000).export(str(path))
    else:
        mesh.export(str(path))
    return path


@pytest.mark.parametrize("ending", meshes.FORMATS)
def test_every_format_gives_the_same_box(folder: Path, ending: str) -> None:
    path = write(folder / f"box{ending}", trimesh.creation.box((0.2, 0.4, 0.6)))
    hull = meshes.collision_mesh(path)
    np.testing.assert_allclose(np.ptp(hull.vertices, axis=0), (0.2, 0.4, 0.6), atol=1e-6)
    assert hull.vertices.shape == (8, 3)
    assert hull.faces.shape == (12, 3)
    (part,) = meshes.visual_parts(path)
    np.testing.assert_allclose(part.mesh.vertices.min(axis=0), (-0.1, -0.2, -0.3), atol=1e-6)


@pytest.mark.parametrize("ending", [".glb", ".gltf"])
def test_gltf_has_y_up(folder: Path, ending: str) -> None:
    path = write(folder / f"box{ending}", trimesh.creation.box((0.2, 0.4, 0.6)))
    hull = meshes.collision_mesh(path, upright=True)
    np.testing.assert_allclose(np.ptp(hull.vertices, axis=0), (0.2, 0.6, 0.4), atol=1e-6)


def test_3mf_has_a_unit_and_stays_within_its_package(folder: Path) -> None:
    path = write(folder / "box.3mf", trimesh.creation.box((0.2, 0.4, 0.6)))
    with zipfile.ZipFile(path) as package:
        parts = {name: package.read(name) for name in package.namelist()}
    (model,) = (name for name in parts if name.endswith(".model"))

    def changed(name: str, old: bytes, new: bytes) -> Path:
        assert old in parts[model]
        with zipfile.ZipFile(folder / name, "w") as package:
            for part, data in parts.items():
                package.writestr(part, data.replace(old, new, 1) if part == model else data)
        return folder / name

    hull = meshes.collision_mesh(changed("inch.3mf", b'unit="millimeter"', b'unit="inch"'))
    np.testing.assert_allclose(np.ptp(hull.vertices, axis=0), np.array((0.2, 0.4, 0.6)) * 25.4, atol=1e-6)
    hull = meshes.collision_mesh(changed("plain.3mf", b' unit="millimeter"', b""))
    np.testing.assert_allclose(np.ptp(hull.vertices, axis=0), (0.2, 0.4, 0.6), atol=1e-6)
    with pytest.raises(AssetError, match=r"its unit is 'cubit'; the units of a \.3mf are micron, millimeter"):
        meshes.collision_mesh(changed("cubit.3mf", b'unit="millimeter"', b'unit="cubit"'))
    with pytest.raises(AssetError, match="made of other objects"):
        meshes.collision_mesh(changed("nested.3mf", b"<mesh>", b"<components/><mesh>"))
    (folder / "broken.3mf").write_bytes(path.read_bytes()[:-40])
    with pytest.raises(AssetError, match="cannot be read as a mesh"):
        meshes.collision_mesh(folder / "broken.3mf")
    with zipfile.ZipFile(folder / "damaged.3mf", "w", zipfile.ZIP_DEFLATED) as package:
        package.writestr("3D/3dmodel.model", b"<model>" * 1000)
    whole = bytearray((folder / "damaged.3mf").read_bytes())
    whole[50:56] = b"\xff" * 6  # inside of what is compressed
    (folder / "damaged.3mf").write_bytes(whole)
    with pytest.raises(AssetError, match="cannot be read as a mesh: Error -3 while decompressing"):
        meshes.collision_mesh(folder / "damaged.3mf")


def test_points_without_a_hull_and_long_names_are_refused_in_a_sentence(folder: Path) -> None:
    for far in (np.inf, np.nan, 1e200):
        with pytest.raises(AssetError, match="not finite, or too far off"):
            meshes.hull_of("far", np.array([[0.0, 0, 0], [far, 0, 0], [0, 1, 0], [0, 0, 1]]), str(far))
    (folder / "long.gltf").write_text('{"buffers": [{"uri": "../' + "x/" * 100_000 + '"}]}')
    with pytest.raises(AssetError, match="cannot be found: its path is longer than 4096 characters") as caught:
        meshes.collision_mesh(folder / "long.gltf")
    assert len(str(caught.value)) < 1000


def test_triangles_of_vertices_that_are_not_there_are_refused(folder: Path) -> None:
    data = write(folder / "box.glb", trimesh.creation.box((0.2, 0.4, 0.6))).read_bytes()
    first = 28 + int.from_bytes(data[12:16], "little")  # of the indices, behind the JSON
    (folder / "wrong.glb").write_bytes(data[:first] + (99).to_bytes(4, "little") + data[first + 4 :])
    with pytest.raises(AssetError, match="a triangle has vertex 99 of"):
        meshes.collision_mesh(folder / "wrong.glb")


def test_buffers_of_a_gltf_lie_in_its_folder(folder: Path) -> None:
    inner = folder / "inner"
    inner.mkdir()
    path = write(inner / "box.gltf", trimesh.creation.box((0.2, 0.4, 0.6)))
    first = meshes.collision_mesh(path).hash
    buffer = inner / "gltf_buffer_0.bin"
    buffer.write_bytes(buffer.read_bytes() + bytes(4))
    assert meshes.collision_mesh(path).hash != first, "another buffer is another mesh"
    path.write_text(path.read_text().replace("gltf_buffer_0.bin", "../secret.bin"))
    (folder / "secret.bin").write_bytes(buffer.read_bytes())
    with pytest.raises(AssetError, match="outside of its folder"):
        meshes.collision_mesh(path)


def test_scale_may_mirror_and_faces_stay_outward(folder: Path) -> None:
    path = write(
        folder / "wedge.stl",
        trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
    )
    (part,) = meshes.visual_parts(path, (-0.1, 0.1, 0.1))
    np.testing.assert_allclose(part.mesh.vertices.min(axis=0), (-0.1, 0, 0), atol=1e-7)
    solid = trimesh.Trimesh(part.mesh.vertices, part.mesh.faces)
    assert solid.volume == pytest.approx(1e-3, rel=1e-5)


def dae(folder: Path, *, unit: str = "1", up: str = "Z_UP") -> Path:
    path = write(folder / "box.dae", trimesh.creation.box((2, 4, 6)))
    text = path.read_text()
    start, stop = text.index("<asset>"), text.index("</asset>")
    asset = f'<asset><unit name="u" meter="{unit}"/><up_axis>{up}</up_axis>'
    path.write_text(text[:start] + asset + text[stop:])
    return path


def test_the_unit_of_a_dae_is_applied(folder: Path) -> None:
    hull = meshes.collision_mesh(dae(folder, unit="0.01"))
    np.testing.assert_allclose(np.ptp(hull.vertices, axis=0), (0.02, 0.04, 0.06), atol=1e-7)


@pytest.mark.parametrize(
    "unit",
    [
        "<unit meter='0.01'/>",
        '<unit meter = "0.01"></unit>',
        '<unit name="a > b" meter="0.01"/>',
        f'<unit name="{400 * "x"}" meter="0.01"/>',
        '<!-- <unit meter="5"/> --><unit meter="0.01"/>',
        '<unit meter="&#48;.01"/>',
    ],
)
def test_the_unit_of_a_dae_is_read_however_it_is_written(folder: Path, unit: str) -> None:
    path = dae(folder)
    path.write_text(path.read_text().replace('<unit name="u" meter="1"/>', unit))
    hull = meshes.collision_mesh(path)
    np.testing.assert_allclose(np.ptp(hull.vertices, axis=0), (0.02, 0.04, 0.06), atol=1e-7)


@pytest.mark.parametrize("unit", ["abc", "", "nan", "-1", "0", "inf", "0,01", "1 2", "\u00e9", 5000 * "a"])
def test_a_unit_that_is_no_number_ends_in_a_sentence(folder: Path, unit: str) -> None:
    path = dae(folder, unit=unit)
    for read in (meshes.collision_mesh, meshes.whole_mesh, meshes.visual_parts):
        with pytest.raises(AssetError, match=r"box\.dae: <unit meter='.{0,30}'> is not the number of metres") as told:
            read(path)
        assert "such as 0.001" in str(told.value)


def test_a_dae_without_a_unit_is_in_metres_and_one_of_a_part_is_none(folder: Path) -> None:
    path = dae(folder)
    text = path.read_text().replace('<unit name="u" meter="1"/>', "")
    path.write_text(text.replace("<library_geometries>", '<library_geometries><asset><unit meter="9"/></asset>'))
    np.testing.assert_allclose(np.ptp(meshes.collision_mesh(path).vertices, axis=0), (2, 4, 6), atol=1e-6)


@pytest.mark.parametrize(("up", "size"), [("Z_UP", (2, 4, 6)), ("Y_UP", (2, 6, 4)), ("X_UP", (4, 6, 2))])
def test_the_up_axis_counts_for_objects_and_not_in_urdfs(folder: Path, up: str, size: tuple[float, ...]) -> None:
    path = dae(folder, up=up)
    np.testing.assert_allclose(np.ptp(meshes.collision_mesh(path).vertices, axis=0), (2, 4, 6), atol=1e-6)
    upright = meshes.collision_mesh(path, upright=True)
    np.testing.assert_allclose(np.ptp(upright.vertices, axis=0), size, atol=1e-6)


def test_entities_in_a_dae_are_refused(folder: Path) -> None:
    path = dae(folder)
    path.write_text(path.read_text().replace("<asset>", "<!-- <!ENTITY a 'b'> --><asset>"))
    with pytest.raises(AssetError, match="entities"):
        meshes.collision_mesh(path)


def test_colours_are_kept_apart_and_merged_when_many(folder: Path) -> None:
    lines, materials = ["mtllib many.mtl"], []
    for i in range(9):
        materials.append(f"newmtl m{i}\nKd {i / 10} 0 0")
        x = i * 1.0
        lines += [f"v {x} 0 0", f"v {x + 0.5} 0 0", f"v {x} 1 0", f"v {x} 0 1", f"usemtl m{i}"]
        b = 4 * i
        faces = [f"f {b + 1} {b + 3} {b + 2}", f"f {b + 1} {b + 2} {b + 4}", f"f {b + 1} {b + 4} {b + 3}"]
        lines += faces if i < 6 else faces[:2]
    (folder / "many.obj").write_text("\n".join(lines))
    (folder / "many.mtl").write_text("\n".join(materials))
    parts = meshes.visual_parts(folder / "many.obj")
    assert len(parts) == meshes.VISUAL_COLORS
    reds = [part.color[0] for part in parts if part.color is not None]
    np.testing.assert_allclose(reds, np.arange(6) / 10, atol=1 / 255)
    assert sum(len(part.mesh.faces) for part in parts) == 24
    assert len(parts[-1].mesh.faces) == 3 + 2 * 3  # the three rarest colours joined the nearest


def test_a_world_and_a_catalogue_entry_say_how_far_looks_may_be_off(folder: Path) -> None:
    write(folder / "ball.stl", trimesh.creation.icosphere(5, 0.1))
    (folder / "ball.urdf").write_text(
        '<robot name="b"><link name="b"><visual><geometry><mesh filename="ball.stl"/></geometry></visual></link>'
        '<link name="c"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
        '</link><joint name="j" type="revolute"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="9" velocity="1"/></joint></robot>'
    )
    entry = {"name": "b", "description": "a ball", "source": "ball.urdf", "license": "MIT", "license_source": "here"}
    entry |= {
        "category": "arm",
        "base": "fixed",
        "home": {"j": 0.0},
        "channels": {"arm": {"joints": ["j"], "gains": {"kp": 1.0, "kd": 1.0}}},
    }
    for name, more in (("follows", {}), ("coarse", {"visual_error": 0.01}), ("whole", {"visual_error": 0})):
        (folder / f"{name}.yaml").write_text(yaml.safe_dump({**entry, **more}))

    def faces(robot: str, **world: object) -> int:
        spec = {"robots": {"b": {"robot": str(folder / f"{robot}.yaml")}}, **world}
        (mesh,) = compile_world(WorldSpec.model_validate(spec)).meshes
        return len(mesh.faces)

    assert (
        faces("follows") <= 3_000 < faces("follows", visual_error=0.0001) < faces("follows", visual_error=0) == 20_480
    )
    assert faces("coarse") == faces("coarse", visual_error=0) <= 3_000
    assert faces("whole") == 20_480
    bare = compile_world(WorldSpec(visual_error=0))
    for added in (
        with_robot(bare, "b", str(folder / "follows.yaml"), {}),
        with_object(bare, "ball", {"source": {"mesh": str(folder / "ball.stl")}, "mass": 1.0}),
    ):
        assert max(len(mesh.faces) for mesh in added.meshes) == 20_480


def test_the_material_file_is_part_of_the_hash(folder: Path) -> None:
    (folder / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl m\nf 1 3 2\nf 1 2 4\n")
    hashes = []
    for red in (0.1, 0.9):
        (folder / "a.mtl").write_text(f"newmtl m\nKd {red} 0 0\n")
        (part,) = meshes.visual_parts(folder / "a.obj")
        assert part.color is not None
        assert part.color[0] == pytest.approx(red, abs=1 / 255)
        hashes.append(part.mesh.hash)
    assert hashes[0] != hashes[1]


def test_budgets_hold_and_results_repeat(folder: Path) -> None:
    path = write(folder / "ball.stl", trimesh.creation.icosphere(5))
    hull = meshes.collision_mesh(path)
    assert len(hull.vertices) == meshes.HULL_VERTICES
    ball = trimesh.Trimesh(hull.vertices, hull.faces)
    assert ball.is_watertight
    assert ball.volume == pytest.approx(4.19, rel=0.1)
    (part,) = meshes.visual_parts(path)
    assert len(part.mesh.faces) < 10_000
    assert part.color is None
    for name in ("again", "cached"):
        if name == "again":
            for file in cache.cache_folder().rglob("*.npz"):
                file.unlink()
        other = meshes.collision_mesh(path)
        np.testing.assert_array_equal(other.vertices, hull.vertices)
        np.testing.assert_array_equal(meshes.visual_parts(path)[0].mesh.vertices, part.mesh.vertices)
        assert other.hash == hull.hash


def test_the_hash_is_of_source_and_processing(folder: Path) -> None:
    path = write(folder / "a.stl", trimesh.creation.box((1, 1, 1)))
    (folder / "sub").mkdir()
    same = folder / "sub" / "b.stl"
    same.write_bytes(path.read_bytes())
    first = meshes.collision_mesh(path)
    assert meshes.collision_mesh(same).hash == first.hash
    assert meshes.collision_mesh(path, (2.0, 1.0, 1.0)).hash != first.hash
    assert meshes.visual_parts(path)[0].mesh.hash != first.hash


def test_arrays_are_read_only(folder: Path) -> None:
    hull = meshes.collision_mesh(write(folder / "a.stl", trimesh.creation.box((1, 1, 1))))
    with pytest.raises(ValueError, match="read-only"):
        hull.vertices[0] = 0


def test_flat_meshes_are_thickened_and_lines_refused() -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]], dtype=float)
    vertices, faces = convex_hull(square, 64)
    assert np.ptp(vertices[:, 2]) == pytest.approx(1e-3)
    assert trimesh.Trimesh(vertices, faces).is_watertight
    with pytest.raises(AssetError, match="in one line"):
        convex_hull(np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2]], dtype=float), 64)
    with pytest.raises(AssetError, match="at least three"):
        convex_hull(np.zeros((5, 3)), 64)


def test_a_small_hull_lies_inside_and_near() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(3000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    vertices, faces = convex_hull(points, 64)
    assert len(vertices) == 64
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    depth = (corners[:, 0] * normals).sum(axis=1)
    assert (depth > 0).all()
    outside = (points @ normals.T - depth).max()
    assert 0 < outside < 0.12
    assert {tuple(v) for v in vertices} <= {tuple(p) for p in points}


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.wrl", b"x", "mesh files are .stl"),
        ("a.stl", b"solid a\nendsolid a\n", "no triangles"),
        ("a.dae", b"<COLLADA", "cannot be read as a mesh"),
        ("a.ply", b"ply\nrubbish", "cannot be read as a mesh"),
    ],
)
def test_bad_files_are_named(folder: Path, name: str, content: bytes, message: str) -> None:
    (folder / name).write_bytes(content)
    with pytest.raises(AssetError, match=message) as caught:
        meshes.visual_parts(folder / name)
    assert str(folder / name) in str(caught.value)
