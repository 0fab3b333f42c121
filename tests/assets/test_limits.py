"""Files that unfold to far more than they are: each is refused by its header, in one sentence, before it is parsed."""

import io
import json
import struct
import time
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from anysim.assets import bounded_files, meshes
from anysim.assets.bounded_files import opened_image
from anysim.assets.ground_files import read_heights
from anysim.errors import AssetError
from anysim_schemas.limits import (
    ARRAY_BYTES,
    ASSET_BYTES,
    GROUND_CELLS,
    IMAGE_BYTES,
    IMAGE_PIXELS,
    MESH_BYTES,
    MESH_FACES,
    MESH_NODES,
    MODEL_DEPTH,
    MODEL_ELEMENTS,
    Limit,
    table,
)
from anysim_urdf.load import import_urdf


@pytest.fixture(autouse=True)
def little_memory() -> Iterator[None]:
    """A refusal costs next to nothing (a few files here are large themselves)."""
    tracemalloc.start()
    yield
    _, peak = tracemalloc.get_traced_memory()  # zeros where a test has stopped it
    tracemalloc.stop()
    assert peak < 100 << 20


def npy(shape: str, descr: str = "'<f8'") -> bytes:
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}"
    header += " " * (63 - (len(header) + 10) % 64) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode()


def png(width: int, height: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    pixels = zlib.compress(b"\0" * 1000)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


def archive(*members: tuple[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in members:
            file.writestr(name, data)
    return out.getvalue()


def claiming(data: bytes, size: int) -> bytes:
    """An archive whose directory claims another size for its only member."""
    at = data.rindex(b"PK\x01\x02")
    return data[: at + 24] + struct.pack("<I", size) + data[at + 28 :]


@pytest.mark.parametrize(
    ("name", "data", "limit", "found"),
    [
        ("a.npy", npy("(1000000, 1000000)"), GROUND_CELLS, 10**12),
        ("a.npz", archive(("a.npy", npy("(1000000, 1000000)"))), GROUND_CELLS, 10**12),
        ("a.npz", claiming(archive(("a.npy", npy("(2, 2)") + bytes(32))), 1 << 31), ARRAY_BYTES, 1 << 31),
        ("a.png", png(12_000, 12_000), GROUND_CELLS, 144_000_000),
        ("a.png", png(30_000, 30_000), GROUND_CELLS, None),
    ],
    ids=["array", "packed", "unfolding", "image", "bomb"],
)
def test_heights_are_counted_before_they_are_read(
    tmp_path: Path, name: str, data: bytes, limit: Limit, found: int | None
) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(AssetError) as caught:
        read_heights(tmp_path / name, (0.0, 1.0))
    assert str(caught.value) == f"{tmp_path / name}: {limit.sentence(found)}"


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.npy", npy("(-1, 5)")),
        ("a.npy", npy("(3, 3)")),
        ("a.npy", npy("(2, 2)", "'|O'") + bytes(32)),
        ("a.npy", b"\x93NUMPY\x03\x00" + b"\0" * 200),
        ("a.npy", npy("(2, 2)")[:20]),
        ("a.npy", npy("[" * 9000)),
        ("a.npz", archive(("a.npy", b"cos\nsystem\n(S'id'\ntR."))),
        ("a.npz", claiming(archive(("a.npy", npy("(2, 2)") + bytes(32))), 5)),
        ("a.npz", archive(("a.npy", b""), ("b.npy", b""))),
        ("a.npz", archive()),
        ("a.png", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n"),
        ("a.png", png(100, 100)),
        ("a.tif", b"II*\0" + bytes(40)),
        ("a.jpg", b""),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_damaged_heights_are_named(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(AssetError, match=r"a\.\w+: (cannot be read as|expected)"):
        read_heights(tmp_path / name, (0.0, 1.0))


def test_images_of_textures_have_a_limit(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png(9000, 9000))
    with pytest.raises(AssetError, match=r"has 81,000,000 pixels; the limit of an image is 67,108,864"):
        opened_image(tmp_path / "a.png").__enter__()
    assert IMAGE_PIXELS.value == 67_108_864


@pytest.mark.parametrize(
    ("name", "limit", "read"),
    [
        ("a.npy", ARRAY_BYTES, lambda path: read_heights(path, None)),
        ("a.png", IMAGE_BYTES, lambda path: read_heights(path, (0.0, 1.0))),
        ("a.stl", MESH_BYTES, meshes.visual_parts),
        ("a.obj", MESH_BYTES, meshes.collision_mesh),
    ],
)
def test_files_are_bounded_unread(tmp_path: Path, name: str, limit: Limit, read: Callable[[Path], object]) -> None:
    with (tmp_path / name).open("wb") as file:
        file.truncate(limit.value + 1)
    with pytest.raises(AssetError, match=limit.sentence(limit.value + 1)):
        read(tmp_path / name)


def stl(faces: int) -> bytes:
    return b"\0" * 80 + struct.pack("<I", faces) + bytes(50 * faces)


def glb(tree: object) -> bytes:
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    return b"glTF" + struct.pack("<IIII", 2, 20 + len(text), len(text), 0x4E4F534A) + text


def dae(body: str) -> bytes:
    return f'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">{body}</COLLADA>'.encode()


def doubling(levels: int) -> bytes:
    nodes = "".join(
        f'<node id="n{i}"><instance_node url="#n{i + 1}"/><instance_node url="#n{i + 1}"/></node>'
        for i in range(levels)
    )
    scene = '<visual_scene id="s"><node id="t"><instance_node url="#n0"/></node></visual_scene>'
    return dae(f"<library_nodes>{nodes}</library_nodes><library_visual_scenes>{scene}</library_visual_scenes>")


TOO_MANY = MESH_FACES.value + 1


@pytest.mark.parametrize(
    ("name", "data", "limit"),
    [
        ("a.stl", stl(TOO_MANY), MESH_FACES),
        ("a.STL", b"solid a\n" + b"endfacet\n" * TOO_MANY, MESH_FACES),
        ("a.obj", b"v 0 0 0\n" + b"f 1 1 1\n" * TOO_MANY, MESH_FACES),
        ("a.obj", b"v 0 0 0\nf" + b" 1" * (TOO_MANY + 2) + b"\n", MESH_FACES),
        ("a.obj", b"v 0 0 0\n" + b"usemtl x\nf 1 1 1\n" * (MESH_NODES.value + 1), MESH_NODES),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nelement face 2000000000\nend_header\n", MESH_FACES),
        ("a.glb", glb({"accessors": [{"count": 10**10}]}), MESH_FACES),
        ("a.glb", glb({"nodes": [{}] * (MESH_NODES.value + 1)}), MESH_NODES),
        ("a.dae", dae('<polylist count="300001"/><triangles material="m" count="300000"/>'), MESH_FACES),
        ("a.dae", doubling(40), MESH_NODES),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_meshes_are_counted_before_they_are_parsed(tmp_path: Path, name: str, data: bytes, limit: Limit) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(AssetError, match=limit.thing) as caught:
        meshes.visual_parts(tmp_path / name)
    assert limit.remedy in str(caught.value)


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.dae", dae("<node>").decode().encode("utf-16"), "its encoding is not UTF-8"),
        ("a.dae", b'<?xml version="1.0" encoding="UTF-7"?>' + dae(""), "its encoding is not UTF-8"),
        ("a.dae", b"<!DOCTYPE a [<!ENTITY b SYSTEM 'file:///etc/passwd'>]>" + dae("&b;"), "declares XML entities"),
        ("a.dae", doubling(2).replace(b"#n1", b"#n0"), "contains itself"),
        ("a.glb", glb([]), "cannot be read as a mesh"),
        ("a.glb", b"glTF", "cannot be read as a mesh"),
        ("a.glb", glb({"accessors": [{"count": None}]}), "cannot be read as a mesh"),
        ("a.ply", b"ply\nelement face x\n", "cannot be read as a mesh"),
        ("a.dae", dae('<asset><unit meter="abc"/></asset>'), "a.dae: "),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_damaged_meshes_are_named(tmp_path: Path, name: str, data: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(AssetError, match=words):
        meshes.visual_parts(tmp_path / name)


def test_a_geometry_that_is_there_a_thousand_times_counts_so_often(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import trimesh

    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box(), geom_name="box")
    for _ in range(9):
        scene.graph.update(frame_to=f"n{_}", geometry="box", matrix=np.eye(4))
    (tmp_path / "a.glb").write_bytes(scene.export(file_type="glb"))
    assert meshes.visual_parts(tmp_path / "a.glb")
    monkeypatch.setattr(meshes, "MESH_FACES", MESH_FACES._replace(value=100))
    monkeypatch.setattr(bounded_files, "MESH_FACES", MESH_FACES._replace(value=100))
    with pytest.raises(AssetError, match="has 108 triangles"):
        meshes.collision_mesh(tmp_path / "a.glb")


def test_a_model_has_a_budget_for_all_its_meshes(tmp_path: Path) -> None:
    mesh = "<visual><geometry><mesh filename='a.stl' scale='{0} {0} {0}'/></geometry></visual>"
    links = "".join(f"<link name='l{i}'>{mesh.format(1 + i)}</link>" for i in range(5))
    joints = "".join(
        f"<joint name='j{i}' type='fixed'><parent link='l0'/><child link='l{i}'/></joint>" for i in range(1, 5)
    )
    (tmp_path / "a.urdf").write_text(f"<robot name='r'>{links}{joints}</robot>")
    with (tmp_path / "a.stl").open("wb") as file:
        file.truncate(MESH_BYTES.value + 1)
    with pytest.raises(AssetError, match=ASSET_BYTES.sentence(4 * (MESH_BYTES.value + 1))):
        import_urdf(tmp_path / "a.urdf", root=tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot name='r'>" + "<link name='a'/>" * MODEL_ELEMENTS.value + "</robot>", MODEL_ELEMENTS.remedy),
        ("<robot name='r'>" + "<a>" * 300 + "</a>" * 300 + "</robot>", MODEL_DEPTH.sentence()),
        ("<?xml version='1.0' encoding='UTF-7'?><robot name='r'/>", "its encoding is not UTF-8"),
    ],
    ids=["elements", "depth", "encoding"],
)
def test_a_urdf_has_a_budget(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.urdf").write_text(text)
    with pytest.raises(AssetError, match=words):
        import_urdf(tmp_path / "a.urdf", root=tmp_path)


def test_the_page_of_limits_is_the_code() -> None:
    page = (Path(__file__).parents[2] / "docs" / "limits.md").read_text("utf-8")
    assert table() in page


def test_the_largest_mesh_of_the_catalogue_is_far_below() -> None:
    """The largest that any installed description has: 351,394 triangles, 29 MB."""
    assert MESH_FACES.value > 1.5 * 351_394
    assert MESH_BYTES.value > 4 * 28_766_640


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.dae", b"<triangles " * 500_000),
        ("a.dae", b"<unit " * 500_000),
        ("a.dae", b"<up_axis>" * 500_000),
        ("a.dae", b"<asset>" * 500_000),
        ("a.dae", b"<a>" + b"<asset/>" * 500_000),
        ("a.dae", b"<a><b>" + b"<asset/>" * 500_000),
        ("a.obj", b"f 1\n" * 2_000_000),
        ("a.obj", b" v" * 2_000_000),
        ("a.obj", b"mtllib\n\n" * 500_000),
        ("a.ply", b"element " * 500_000),
        ("a.stl", b"facet normal " * 500_000),
        ("a.glb", b"[" * 4_000_000),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_no_search_is_quadratic(tmp_path: Path, name: str, data: bytes) -> None:
    tracemalloc.stop()  # it takes most of the time
    (tmp_path / name).write_bytes(data)
    start = time.process_time()
    with pytest.raises(AssetError):
        meshes.visual_parts(tmp_path / name)
    assert time.process_time() - start < 5.0
