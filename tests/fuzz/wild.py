"""Folders of model files that nobody wrote: mutated models, scenes and meshes, beside traps of the file system.

What a number makes follows from the number alone, so that one that fails can be made again. Outside of the folder that
an input may read lies a mesh of its own size and a word: neither may come to light, and a hook of the interpreter
notes each file that is opened elsewhere.
"""

import io
import os
import re
import sys
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from anysim.api import compile_world, load
from anysim.assets.scene import PART
from anysim.errors import AnysimError
from tests.fuzz.test_models import CORNERS, FACES, MJCF, NUMBERS, PART as BOLT, SDF, URDF, mutated, pick

SCENE_SDF = """<sdf version="1.9"><world name="room"><gravity>0 0 -9.8</gravity><light name="sun" type="directional">
<direction>0 0.1 -1</direction></light><model name="ground"><static>true</static><link name="l"><collision name="c">
<geometry><plane><normal>0 0 1</normal></plane></geometry></collision></link></model>
<model name="box"><pose>0 0 1 0 0 0.5</pose><link name="l"><inertial><mass>1</mass></inertial><collision name="c">
<geometry><mesh><uri>tetra.obj</uri></mesh></geometry></collision></link></model>
<include><uri>model://parts</uri><name>bolt</name><pose>1 0 0.1 0 0 0</pose></include></world></sdf>"""
_BALL = '<body name="ball" pos="1 0 1"><freejoint/><geom size="0.1"/></body></worldbody>'
SCENE_MJCF = MJCF.replace("</worldbody>", _BALL)
URDF_SDF_MJCF = {"urdf": URDF, "sdf": SDF, "xml": MJCF}
SECRET, SECRET_SIZE = "xyzzy-the-word", 0.77731
_ENDINGS = ("stl", "obj", "ply", "off", "glb", "gltf", "3mf", "dae")
_THINGS = ("link.obj", "loop.obj", "pipe.obj", "folder.obj", "sparse.obj", "link.stl", "out.urdf", "tetra.obj/a.obj")
_TRAPS = (
    "../../outside/secret.obj",
    "link.obj",
    "way/secret.obj",
    "loop.obj",
    "pipe.obj",
    "folder.obj",
    "sparse.obj",
    "/dev/zero",
    "/proc/self/environ",
    "package://outside/secret.obj",
    "file://OUTSIDE/secret.obj",
    "OUTSIDE/secret.obj",
    "parts/../../../outside/secret.obj",
    "link.stl",
    "",
    "tetra.obj\x7f",
)
"""What a reference names instead of a mesh; OUTSIDE is the absolute path of the folder outside."""
_BOMBS = (
    '<!DOCTYPE r [<!ENTITY a "{ten}"><!ENTITY b "{a}"><!ENTITY c "{b}"><!ENTITY d "{c}"><!ENTITY e "{d}">]>',
    '<!DOCTYPE r [<!ENTITY x SYSTEM "file://OUTSIDE/secret.txt">]>',
    '<!DOCTYPE r SYSTEM "file://OUTSIDE/secret.txt">',
    '<!DOCTYPE r [<!ENTITY % p SYSTEM "OUTSIDE/secret.txt"> %p;]>',
    '<?xml-stylesheet href="OUTSIDE/secret.txt"?>',
)
_INCLUDES = (
    '<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="OUTSIDE/secret.txt" parse="text"/>',
    '<include file="../../outside/secret.xml"/>',
    '<include file="MODEL"/>',
    "<include><uri>model://parts/../../../outside</uri></include>",
    "<include><uri>MODEL</uri></include>",
)


class Opened:
    """The files that are opened while `watching`, outside of what a program reads of itself and of `folders`."""

    def __init__(self, *folders: Path) -> None:
        own = (sys.prefix, sys.base_prefix, str(Path(__file__).parents[2]), "/dev/null", "/dev/urandom", "/proc/self/")
        real = [os.path.realpath(f) for f in (*own, *folders)]
        self._known = (*real, "/proc/self/", "/sys/", "/usr/lib", "/lib")
        self.watching = False
        self.seen: list[str] = []
        sys.addaudithook(self._hook)

    def _hook(self, event: str, given: tuple[Any, ...]) -> None:
        if event != "open" or not self.watching or not isinstance(given[0], str | bytes | os.PathLike):
            return
        path = os.path.realpath(os.fsdecode(given[0]))
        if not path.startswith(self._known):
            self.seen.append(path)


class Wild:
    """A folder, what lies around it, and the inputs that are made in it."""

    def __init__(self, around: Path) -> None:
        self.outside = around / "outside"
        self.folder = around / "in" / "model"
        for place in (self.outside, self.folder / "parts", self.folder / "folder.obj"):
            place.mkdir(parents=True)
        tetra = _obj(np.array(CORNERS))
        (self.folder / "tetra.obj").write_text(tetra)
        (self.folder / "parts" / "tetra.stl").write_bytes(_stl())
        (self.folder / "parts" / "model.sdf").write_text(BOLT)
        (self.outside / "secret.obj").write_text(_obj(np.array(CORNERS) / 0.1 * SECRET_SIZE))
        (self.outside / "secret.txt").write_text(SECRET)
        (self.outside / "secret.xml").write_text(f"<mujoco model='{SECRET}'/>")
        (self.outside / "model.sdf").write_text(BOLT.replace("part", SECRET))
        for name, target in (("link.obj", "secret.obj"), ("link.stl", "secret.obj"), ("way", ""), ("out.urdf", "x")):
            (self.folder / name).symlink_to(self.outside / target)
        (self.folder / "loop.obj").symlink_to(self.folder / "loop.obj")
        os.mkfifo(self.folder / "pipe.obj")
        with (self.folder / "sparse.obj").open("wb") as file:
            file.truncate(1 << 40)
        self.meshes = _meshes()
        self.opened = Opened(self.folder, Path(os.environ["ANYSIM_CACHE_DIR"]))

    def attempt(self, number: int) -> Callable[[], None]:
        """What reads the input of a number, which is written now.

        It raises an AssertionError where the world, or the sentence that refuses it, holds what it may not.
        """
        rng = np.random.default_rng([number, 20])
        kind = pick(rng, ["urdf", "xml", "sdf", "scene.xml", "scene.sdf", "mesh", "mesh"])
        spec = self._mesh(rng, number) if kind == "mesh" else self._model(rng, number, kind)

        def run() -> None:
            self.opened.watching = True
            said = ""
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # numbers of 1e300 overflow on their way to a refusal
                    world = compile_world(load(spec))
                said = repr((world.name, world.bodies, world.joints, world.geoms, world.sites))
                assert not re.search(r"[=( ]nan[,)]", said), "a number that is none is in the World"
                sizes = [float(np.ptp(mesh.vertices, axis=0).max()) for mesh in world.meshes]
                assert not any(abs(size - SECRET_SIZE) < 1e-4 for size in sizes), "it holds a mesh from outside"
            except AnysimError as error:
                said = str(error)
                assert len(said) < 20_000, f"a sentence of {len(said)} letters"
                raise
            finally:
                self.opened.watching = False
                opened, self.opened.seen = self.opened.seen, []
                assert "repair the package" not in said, f"a reader failed: {said[:300]}"
                assert SECRET not in said, "it tells what is in a file outside"
                assert not opened, f"it opened {opened[:3]}"

        return run

    # ------------------------------------------------------------------ models and scenes

    def _model(self, rng: np.random.Generator, number: int, kind: str) -> dict[str, Any]:
        """A mutated model or scene, with traps, bombs and inclusions of some."""
        text = {"scene.xml": SCENE_MJCF, "scene.sdf": SCENE_SDF} | URDF_SDF_MJCF
        data = mutated(text[kind], number)
        file = self.folder / f"model.{kind.rpartition('.')[2]}"
        how = rng.random()
        if how < 0.3:
            data = data.replace(b"tetra.obj", etree_text(self._trap(rng)), 1)
        elif how < 0.4:
            data = self._with_bomb(rng, data)
        elif how < 0.5:
            more = pick(rng, _INCLUDES).replace("OUTSIDE", str(self.outside)).replace("MODEL", file.name)
            at = data.find(b">") + 1
            data = data[:at] + more.encode() + data[at:]
        elif how < 0.56:
            data = pick(
                rng, [b"", b" " * 100_000, data * 400, b"\xff\xfe" + data.decode("latin-1").encode("utf-16-le")]
            )
        self._written(file, data, rng)
        shown: dict[str, Any] = {"objects": {"it": {"source": file.name, "fixed": bool(number % 2)}}}
        if kind.startswith("scene"):
            body = pick(rng, [""] * 20 + [f"#{PART}box", "#" + "x" * 300])
            shown = {"source": f"{self.folder}/{file.name}{body}"}
        elif rng.random() < 0.2:
            shown["objects"]["it"]["source"] = {"asset": f"{self.folder}/{file.name}", "collision": "primitives"}
        else:
            shown["objects"]["it"]["source"] = f"{self.folder}/{file.name}"
        if rng.random() < 0.02:
            shown = {"objects": {"it": {"source": f"{self.folder}/{pick(rng, _THINGS)}"}}}
        return {"world": shown}

    def _trap(self, rng: np.random.Generator) -> str:
        return pick(rng, _TRAPS).replace("OUTSIDE", str(self.outside))

    def _with_bomb(self, rng: np.random.Generator, data: bytes) -> bytes:
        names = {name: f"&{name};" * 10 for name in "abcd"} | {"ten": "x" * 10}
        bomb = pick(rng, _BOMBS).replace("OUTSIDE", str(self.outside))
        bomb = bomb.format(**names) if "{" in bomb else bomb
        name = b"&e;" if "ENTITY e" in bomb else b"&x;"
        return bomb.encode() + re.sub(rb'name="\w+"', b'name="' + name + b'"', data, count=1)

    def _written(self, file: Path, data: bytes, rng: np.random.Generator) -> None:
        """The file itself; seldom, a link to one outside, a folder, a pipe or a file without an end in its place."""
        if file.is_dir() and not file.is_symlink():
            file.rmdir()
        file.unlink(missing_ok=True)
        odd = rng.random()
        if odd < 0.01:
            (self.outside / file.name).write_bytes(data)
            file.symlink_to(self.outside / file.name)
        elif odd < 0.015:
            file.mkdir()
        elif odd < 0.02:
            os.mkfifo(file)
        elif odd < 0.025:
            with file.open("wb") as sparse:
                sparse.write(data)
                sparse.truncate(1 << 40)
        else:
            file.write_bytes(data)

    # ------------------------------------------------------------------ meshes

    def _mesh(self, rng: np.random.Generator, number: int) -> dict[str, Any]:
        """A mutated mesh, seldom under the ending of another format."""
        kind = pick(rng, list(self.meshes))
        data = self.meshes[kind]
        for _ in range(pick(rng, [1, 1, 1, 3])):
            data = _scratched(rng, kind, data, str(self.outside))
        ending = kind.partition(" ")[0] if rng.random() < 0.93 else pick(rng, _ENDINGS)
        file = self.folder / f"mesh.{ending}"
        self._written(file, data, rng)
        collision = pick(rng, [None, None, "hull", "primitives", "mesh"])
        source: dict[str, Any] = {"mesh": f"{self.folder}/{file.name}"}
        source |= {"collision": collision} if collision else {}
        return {"world": {"objects": {"it": {"source": source, "fixed": collision == "mesh" or bool(number % 2)}}}}


def etree_text(text: str) -> bytes:
    """A text as it stands in XML; characters that it cannot hold are left as they are."""
    made = etree.Element("a")
    try:
        made.text = text
    except ValueError:
        return text.encode()
    return etree.tostring(made)[3:-4]


def _obj(corners: np.ndarray) -> str:
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES]
    return "\n".join(lines) + "\n"


def _stl() -> bytes:
    import trimesh

    return bytes(trimesh.Trimesh(CORNERS, FACES).export(file_type="stl"))


def _meshes() -> dict[str, bytes]:
    """A small file of each format; of .gltf with its buffer inside, of .obj with materials."""
    import trimesh

    mesh = trimesh.creation.icosphere(1, 0.1)
    made: dict[str, Any] = {kind: mesh.export(file_type=kind) for kind in ("stl", "obj", "ply", "off", "glb", "3mf")}
    made |= {"stl ascii": mesh.export(file_type="stl_ascii"), "gltf": _gltf(mesh), "dae": _dae(mesh)}
    made["obj"] = "mtllib OUTSIDE/secret.txt\nmtllib a.mtl\nusemtl m\n" + made["obj"]
    return {kind: data.encode() if isinstance(data, str) else bytes(data) for kind, data in made.items()}


def _gltf(mesh: Any) -> bytes:
    import base64
    import json

    points, faces = mesh.vertices.astype("<f4").tobytes(), mesh.faces.astype("<u4").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(points + faces).decode()
    views = [{"buffer": 0, "byteOffset": 0, "byteLength": len(points)}]
    views.append({"buffer": 0, "byteOffset": len(points), "byteLength": len(faces)})
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(mesh.vertices), "type": "VEC3"},
        {"bufferView": 1, "componentType": 5125, "count": 3 * len(mesh.faces), "type": "SCALAR"},
    ]
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "children": [1], "translation": [0.0, 0.0, 0.1]}, {"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"uri": uri, "byteLength": len(points + faces)}, {"uri": "more.bin", "byteLength": 9}][:1],
    }
    return json.dumps(tree).encode()


def _dae(mesh: Any) -> bytes:
    points = " ".join(f"{v:.4f}" for v in mesh.vertices.ravel())
    faces = " ".join(str(v) for v in mesh.faces.ravel())
    return f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><unit meter="1"/>
<up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh><source id="s"><float_array id="f"
count="{mesh.vertices.size}">{points}</float_array><technique_common><accessor source="#f" count="{len(mesh.vertices)}"
stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source><vertices id="v"><input semantic="POSITION" source="#s"/></vertices><triangles
count="{len(mesh.faces)}"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles></mesh></geometry>
</library_geometries><library_visual_scenes><visual_scene id="w"><node><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>""".encode()


_WORD = re.compile(rb"-?\d+\.?\d*(?:e-?\d+)?")


def _scratched(rng: np.random.Generator, kind: str, data: bytes, outside: str) -> bytes:
    """The bytes of a mesh with one thing changed."""
    if not data:
        return data
    at, end = sorted(int(v) for v in rng.integers(len(data), size=2))
    how = pick(
        rng, ["cut", "bytes", "number", "digit", "digit", "word", "less", "more", "often", "large", "zip", "path"]
    )
    if how == "cut":
        return data[:at]
    if how == "bytes":
        return data[:at] + rng.bytes(int(rng.integers(1, 9))) + data[at + int(rng.integers(9)) :]
    if how == "number" and (found := list(_WORD.finditer(data[:200_000]))):
        one = pick(rng, found)
        return data[: one.start()] + pick(rng, NUMBERS).encode() + data[one.end() :]
    if how == "digit" and (found := list(re.finditer(rb"[0-9]", data[:200_000]))):
        at = pick(rng, found).start()
        return data[:at] + str(int(rng.integers(10))).encode() + data[at + 1 :]
    if how == "word" and len(data) > 8:
        word = pick(rng, [b"\xff" * 4, b"\0" * 4, b"\xff\xff\xff\x7f", b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\1\0\0\0"])
        at = (at // 4) * 4
        return data[:at] + word + data[at + 4 :]
    if how == "less":
        return data[:at] + data[end:]
    if how == "more":
        return data[:end] + data[at:]
    if how == "often":
        return data[:end] + data[at:end][:4000] * int(rng.integers(2, 500)) + data[end:]
    if how == "large" and kind in ("stl", "glb"):
        place = 80 if kind == "stl" else pick(rng, [8, 12])
        return data[:place] + int(rng.integers(2**32)).to_bytes(4, "little") + data[place + 4 :]
    if how == "zip" and kind == "3mf":
        return _zipped(rng, data)
    if how == "path":
        old, new = pick(rng, [(b"a.mtl", b"../../outside/secret.txt"), (b"data:", outside.encode() + b"/secret.txt#")])
        return data.replace(b"OUTSIDE", outside.encode()).replace(old, new)
    return data[::-1] if rng.random() < 0.05 else data[:at] + data[at : at + 50] + data[at:]


def _zipped(rng: np.random.Generator, data: bytes) -> bytes:
    """The archive with a member changed, left out, or as large as it is empty."""
    made = io.BytesIO()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as new:
            for name in old.namelist():
                content = old.read(name)
                if name.endswith(".model"):
                    way = rng.random()
                    if way < 0.1:
                        content = b"\0" * (300 << 20)
                    elif way < 0.9:
                        content = _scratched(rng, "xml", content, "")
                if rng.random() < 0.95:
                    new.writestr(pick(rng, [name] * 20 + ["../" + name]), content)
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, OSError, EOFError, ValueError, RuntimeError):
        return data[: len(data) // 2]
    return made.getvalue()
