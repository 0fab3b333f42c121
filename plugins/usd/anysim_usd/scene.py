"""Whole USD files as worlds: each tree of bodies is an object, with its place; lights, cameras, physics and the ground.

What no body moves is one object `surroundings`, which stands. A plane that collides, level and at height 0, is the
ground; without one there is none.
"""

from collections.abc import Mapping
from math import atan, degrees
from pathlib import Path
from typing import Any

import numpy as np

from anysim.assets.bounded_files import check
from anysim.assets.model import ImportNote
from anysim.assets.scene import PART, control_step, free_name, placed
from anysim.conventions import GROUND, Array
from anysim.math import pose as P
from anysim.model.world import Body, BodyKind
from anysim_schemas.limits import SCENE_PARTS
from anysim_schemas.scene import ImportedScene, SceneEntry
from anysim_usd.files import opened
from anysim_usd.looks import GREY, LookReader
from anysim_usd.numbers import authored, exact, exact_vector, get, given, plain, real, vector
from anysim_usd.pairs import excluded_pairs
from anysim_usd.shapes import KINDS, collides, is_level
from anysim_usd.space import IDENTITY, Space
from anysim_usd.structure import BASE, Structure, Tree
from anysim_usd.unheld import told, unread

_EARTH = 9.81
_BRIGHT = 0.8
"""The intensity of the brightest light of a world: photometric units have no one meaning here."""
_WIDTH = 640  # pixels of a camera, of which a file says none
_OPTICAL = np.array([1.0, 0.0, 0.0, 0.0])  # from x right, y up, z back to x right, y down, z ahead


def read_usd_scene(path: Path, *, root: Path, uri: str, packages: Mapping[str, Path]) -> ImportedScene:
    """What a USD file says of a run; see `anysim.assets.scene`.

    Raises:
        AssetError: see `anysim_usd.files.opened`; a joint that closes a loop.
    """
    notes: list[ImportNote] = []
    with opened(path, root) as (stage, said):
        scene = _Scene(path, uri, Structure(stage, path, Space(stage, path, 1.0, notes), notes), notes).read()
    late = tuple(("dropped", "stage", line) for line in said)
    return scene._replace(notes=(*scene.notes, *late))


class _Scene:
    def __init__(self, path: Path, uri: str, structure: Structure, notes: list[ImportNote]) -> None:
        self.path, self.uri, self.structure, self.space = path, uri, structure, structure.space
        self.notes: list[ImportNote] = [note for note in notes if note.where == "stage"]  # the rest is of its objects
        self.looks = LookReader(self.space, self.notes)
        self.entries: list[SceneEntry] = []
        self.taken: list[str] = [GROUND]

    def read(self) -> ImportedScene:
        self._name_of_the_world()
        self._physics()
        around = [prim for prim in self.structure.prims if self.structure.owner[str(prim.GetPath())] == BASE]
        shapes = [prim for prim in around if str(prim.GetTypeName()) in KINDS]
        ground = [prim for prim in shapes if is_level(prim, self.space)]
        self._put(("world", "terrain"), self._terrain(ground[0]) if ground else {"kind": "none"})
        self._lights()
        cameras: list[str] = []
        for prim in self.structure.prims:
            if str(prim.GetTypeName()) == "Camera":
                self._camera(prim, cameras)
        check(self.path, SCENE_PARTS, len(self.structure.trees))
        names = [self._object(tree) for tree in self.structure.trees]
        self._apart(names)
        if len(shapes) > len(ground):
            self._still()
        self.notes += told(line for prim in around if self._around(prim) for line in unread(prim, world=True))
        return ImportedScene(tuple(self.entries), tuple((n.kind, n.where, n.message) for n in self.notes))

    def _around(self, prim: Any) -> bool:
        """Whether a prim is told of here: shapes, materials and joints are told of with their objects."""
        kind = str(prim.GetTypeName())
        return kind not in KINDS and kind not in ("Material", "Shader", "NodeGraph") and not kind.endswith("Joint")

    def _put(self, keys: tuple[str, ...], value: Any) -> None:
        self.entries.append(SceneEntry(keys, value, str(self.path), 1))

    def _free(self, wanted: str, otherwise: str, taken: list[str]) -> str:
        free = free_name(wanted, otherwise, taken)
        if wanted and free != wanted:
            self.notes.append(ImportNote("info", f"{otherwise} '{wanted}'", f"is called '{free}' here"))
        taken.append(free)
        return free

    # ------------------------------------------------------------------ the world

    def _name_of_the_world(self) -> None:
        prim = self.structure.stage.GetDefaultPrim()
        if prim:
            name = str(get(prim, "anysim:name") or prim.GetName())
            self._put(("world", "name"), free_name(name, "world", []))

    def _physics(self) -> None:
        scenes = [prim for prim in self.structure.prims if str(prim.GetTypeName()) == "PhysicsScene"]
        if len(scenes) > 1:
            self.notes.append(ImportNote("dropped", "PhysicsScene", f"of {len(scenes)} the first is read"))
        down, size, scene = np.array([0.0, 0.0, -1.0]), _EARTH, scenes[0] if scenes else None
        if scene is not None:
            way = vector(scene, "physics:gravityDirection", (0.0, 0.0, 0.0))
            if way.any():
                down = self.space.turn @ (way / np.linalg.norm(way))
            magnitude = given(scene, "physics:gravityMagnitude")
            if magnitude is not None and magnitude >= 0:
                size = magnitude * self.space.unit
        gravity = down * size
        if scene is not None:
            gravity = exact_vector(scene, "gravity", gravity)
        self._put(("physics", "gravity"), [float(v) + 0.0 for v in gravity])
        if scene is None:
            return
        rate, dt = given(scene, "physxScene:timeStepsPerSecond"), given(scene, "mjc:option:timestep")
        if dt is None and rate is not None and rate > 0:
            dt = 1.0 / rate
        if dt is not None and dt > 0:
            self._put(("physics", "dt"), dt)
            self._put(("physics", "control_dt"), control_step(dt))
        cone, ratio = get(scene, "mjc:option:cone"), given(scene, "mjc:option:impratio")
        if cone is not None:
            self._put(("physics", "friction_cone"), str(cone))
        if ratio is not None:
            self._put(("physics", "impratio"), ratio)

    def _terrain(self, prim: Any) -> dict[str, Any]:
        terrain: dict[str, Any] = {"kind": "plane"}
        if self.looks.bound(prim, "physics") is not None:
            terrain["friction"] = self.looks.surface(prim).friction
        color = self.looks.color(prim)
        if color != GREY:
            terrain["color"] = list(color[:3])
        return terrain

    def _lights(self) -> None:
        prims = [
            prim
            for prim in self.structure.prims
            if str(prim.GetTypeName()) in ("DistantLight", "SphereLight", "RectLight", "DiskLight", "CylinderLight")
        ]
        strength = [real(p, "inputs:intensity", 1.0) * 2.0 ** real(p, "inputs:exposure", 0.0) for p in prims]
        own = [given(prim, "anysim:intensity") for prim in prims]
        most, taken = max(strength, default=0.0), list[str]()
        for prim, value, stated in zip(prims, strength, own, strict=True):
            color = vector(prim, "inputs:color", (1.0, 1.0, 1.0))
            pose = self.space.of(prim).pose
            light: dict[str, Any] = {
                "direction": P.rotate(pose[3:], np.array([0.0, 0.0, -1.0])).tolist(),
                "color": [min(1.0, max(0.0, float(v))) for v in color],
                "intensity": exact(prim, "intensity", value) if stated else _BRIGHT * value / most if most > 0 else 0.0,
            }
            if str(prim.GetTypeName()) != "DistantLight":
                light["position"] = pose[:3].tolist()
            self._put(("world", "lights", self._free(_called(prim), "light", taken)), light)
        if prims and not all(own):
            text = f"shine relative to each other: the brightest of {len(prims)} has an intensity of {_BRIGHT}"
            self.notes.append(ImportNote("info", "lights", text))

    def _camera(self, prim: Any, taken: list[str]) -> None:
        wide, high = (real(prim, f"{way}Aperture", 1.0) for way in ("horizontal", "vertical"))
        focal = real(prim, "focalLength", 50.0)
        if not (wide > 0 and high > 0 and focal > 0):
            self.notes.append(ImportNote("dropped", f"camera '{prim.GetName()}'", "has an aperture or a length of 0"))
            return
        fov = exact(prim, "fov", degrees(2 * atan(high / 2 / focal)))
        size = get(prim, "anysim:size")
        pixels = [int(v) for v in size] if size is not None else [_WIDTH, max(1, round(_WIDTH * high / wide))]
        pose = self.space.of(prim).pose
        turn = P.multiply(pose[3:], _OPTICAL)
        ahead = P.rotate(turn, np.array([0.0, 0.0, 1.0]))
        camera: dict[str, Any] = {
            "from": pose[:3].tolist(),
            "look_at": (pose[:3] + ahead).tolist(),
            "fov": fov,
            "size": pixels,
        }
        if authored(prim, "clippingRange"):
            near, far = (float(v) * self.space.unit for v in vector(prim, "clippingRange", (0.01, 20.0)))
            if 0 < near < far:
                camera |= {"near": near, "far": far}
        owner = self.structure.owner[str(prim.GetPath())]
        if owner != BASE:
            name = self.structure.parts[owner].name
            self.notes.append(
                ImportNote("info", f"camera '{prim.GetName()}'", f"moves with '{name}'; it stands still here")
            )
        up = P.rotate(turn, np.array([0.0, -1.0, 0.0]))
        if float(up[2]) < 0.999 * float(np.sqrt(max(0.0, 1.0 - ahead[2] ** 2))) or abs(float(ahead[2])) > 0.9999:
            self.notes.append(ImportNote("info", f"camera '{prim.GetName()}'", "is rolled; it is upright here"))
        self._put(("world", "cameras", self._free(_called(prim), "camera", taken)), camera)

    # ------------------------------------------------------------------ objects

    def _apart(self, names: list[str]) -> None:
        """Pairs of objects of which no shape may meet one of the other."""
        owner = {part: number for number, tree in enumerate(self.structure.trees) for part in tree.parts}
        touched: dict[str, list[Any]] = {}
        for prim in self.structure.prims:
            if collides(prim):
                touched.setdefault(self.structure.owner[str(prim.GetPath())], []).append(prim)
        objects = [Body(name, BodyKind.STATIC) for name in names]
        pairs, notes = excluded_pairs(self.structure, owner, touched, objects)
        self.notes += notes
        if pairs:
            self._put(("world", "collisions", "exclude"), [[names[low], names[high]] for low, high in sorted(pairs)])

    def _object(self, tree: Tree) -> str:
        names = [other.name for other in self.structure.trees]
        prim = self.structure.stage.GetPrimAtPath(tree.path)
        wanted = str(get(prim, "anysim:name") or tree.name)
        here = self._free(wanted, "object", self.taken)
        part = tree.name if names.count(tree.name) == 1 else tree.path.lstrip("/")
        self._put(("world", "objects", here), {"source": {"asset": f"{self.uri}#{PART}{part}"}})
        if tree.fixed:
            self._put(("world", "objects", here, "fixed"), True)
        frame = self.structure.root_frame(tree)
        self._put(("world", "layout", here), placed(*_split(frame)))
        return here

    def _still(self) -> None:
        here = self._free("surroundings", "object", self.taken)
        self._put(("world", "objects", here), {"source": {"asset": f"{self.uri}#{PART}"}, "fixed": True})
        self._put(("world", "layout", here), placed(*_split(IDENTITY)))


def _called(prim: Any) -> str:
    return str(get(prim, "anysim:name") or prim.GetName())


def _split(pose: Array) -> tuple[list[float], list[float]]:
    return [plain(v, single=False) for v in pose[:3]], [float(v) for v in pose[3:]]
