"""Whole SDF files as worlds: each tree of a model is an object, with its place; lights, physics and the ground.

A model whose static link collides as a level plane at height 0 is the ground. Trees without a joint that carries them
float, unless their model is static or tied to the world.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from anysim.assets.bounded_files import check, xml_root
from anysim.assets.model import ImportNote
from anysim.assets.scene import PART, control_step, free_name, placed
from anysim.conventions import GROUND, Array
from anysim.errors import AssetError
from anysim.math import pose as P
from anysim_schemas.limits import SCENE_PARTS
from anysim_schemas.scene import ImportedScene, SceneEntry
from anysim_urdf.sdf import SdfModel
from anysim_urdf.sdf_coverage import notes_of
from anysim_urdf.sdf_file import SdfDocument, document
from anysim_urdf.sdf_frames import IDENTITY, MODEL, WORLD, Frame, Frames, numbers, pose_of

_TRUE = ("true", "1")


def read_sdf_scene(path: Path, *, root: Path, uri: str, packages: Mapping[str, Path]) -> ImportedScene:
    """What an SDF file says of a run; see `anysim.assets.scene`.

    Raises:
        AssetError: see `anysim_urdf.sdf_file.document`; two worlds, or a frame that does not exist.
    """
    read = document(path, root, packages)
    worlds = xml_root(path)[0].findall("world")
    if len(worlds) > 1:
        raise AssetError(f"{path}:{worlds[1].sourceline}: has {len(worlds)} worlds; a scene is one")
    return _Scene(path, uri, read, worlds[0] if worlds else None).read()


class _Scene:
    def __init__(self, path: Path, uri: str, read: SdfDocument, world: Any) -> None:
        self.path, self.uri, self.file, self.world = path, uri, read, world
        self.entries: list[SceneEntry] = []
        self.notes: list[ImportNote] = [] if world is None else notes_of(world)
        self.models = {name: SdfModel(path, one, read.version, None) for name, one in read.models.items()}
        self.frames = Frames(str(path), dict(self._frames()))

    def read(self) -> ImportedScene:
        if self.world is not None:
            self._around(self.world)
        ground = {name: element for name, element in self.file.models.items() if self._is_ground(name, element)}
        if ground:
            first = next(iter(ground.values()))
            self._put(("world", "terrain"), self._terrain(first), first)
            for other in list(ground)[1:]:
                text = f"is a level plane at height 0 as '{next(iter(ground))}' is, which is the ground; it is left out"
                self.notes.append(ImportNote("dropped", f"model '{other}'", text))
        else:
            self._put(("world", "terrain"), {"kind": "none"}, self.world)
        check(self.path, SCENE_PARTS, sum(len(model.roots) for model in self.models.values()))
        taken: list[str] = [GROUND]
        for name, model in self.models.items():
            for link in model.roots if name not in ground else ():
                self._object(name, model, link, taken)
        return ImportedScene(tuple(self.entries), tuple((n.kind, n.where, n.message) for n in self.notes))

    def _put(self, keys: tuple[str, ...], value: Any, element: Any) -> None:
        line = 1 if element is None else element.sourceline
        self.entries.append(SceneEntry(keys, value, str(self.path), line))

    def _name(self, wanted: str, otherwise: str, taken: list[str]) -> str:
        free = free_name(wanted, otherwise, taken)
        if wanted and free != wanted:
            self.notes.append(ImportNote("info", f"{otherwise} '{wanted}'", f"is called '{free}' here"))
        taken.append(free)
        return free

    # ------------------------------------------------------------------ frames

    def _frames(self) -> Any:
        """The frames of the world by name, and those in its models as `MODEL::FRAME`."""
        yield WORLD, Frame(IDENTITY, MODEL, self.world)
        for name, element in self.file.models.items():
            pose, relative = pose_of(element, str(self.path))
            own = self.models[name].frames
            if placed := element.get("placement_frame"):
                pose = P.compose(pose, P.inverse(own.of(placed)))
            yield name, Frame(pose, relative or WORLD, element)
            for part in self.models[name].names():
                yield f"{name}::{part}", Frame(own.of(part), name, element)
        for element in [] if self.world is None else self.world.findall("frame"):
            pose, relative = pose_of(element, str(self.path))
            yield element.get("name") or "", Frame(pose, relative or element.get("attached_to") or WORLD, element)

    def _pose(self, element: Any) -> Array:
        """The pose (7,) of a light or another element of the world, in the world."""
        pose, relative = pose_of(element, str(self.path))
        return P.compose(self.frames.of(relative or WORLD), pose)

    # ------------------------------------------------------------------ the world

    def _around(self, world: Any) -> None:
        name = world.get("name") or ""
        if re.fullmatch(r"[a-zA-Z][a-zA-Z0-9_]*", name):
            self._put(("world", "name"), name, world)
        elif name:
            self.notes.append(ImportNote("info", f"world '{name}'", "is called 'world' here"))
        gravity = world.find("gravity")
        if gravity is not None:
            self._put(("physics", "gravity"), list(numbers(gravity, str(self.path), (3,))), gravity)
        else:
            self._put(("physics", "gravity"), [0.0, 0.0, -9.8], world)
        if (step := world.find("physics/max_step_size")) is not None:
            dt = numbers(step, str(self.path), (1,))[0]
            self._put(("physics", "dt"), dt, step)
            self._put(("physics", "control_dt"), control_step(dt), step)
        taken: list[str] = []
        for light in world.findall("light"):
            self._light(light, taken)
        scene = world.find("scene")
        if scene is not None:
            for key in ("ambient", "background"):
                if (color := scene.find(key)) is not None:
                    self._put(("world", "scenery", key), self._color(color), color)
            if (shadows := scene.find("shadows")) is not None:
                self._put(("world", "scenery", "shadows"), (shadows.text or "").strip() in _TRUE, shadows)

    def _color(self, element: Any) -> list[float]:
        return [min(1.0, max(0.0, v)) for v in numbers(element, str(self.path), (3, 4))[:3]]

    def _light(self, element: Any, taken: list[str]) -> None:
        where = f"light '{element.get('name')}'"
        if (element.findtext("light_on") or "true").strip() not in _TRUE:
            self.notes.append(ImportNote("dropped", where, "is off, and left out"))
            return
        pose = self._pose(element)
        direction, diffuse = element.find("direction"), element.find("diffuse")
        ahead = (0.0, 0.0, -1.0) if direction is None else numbers(direction, str(self.path), (3,))
        color = [1.0, 1.0, 1.0] if diffuse is None else self._color(diffuse)
        strength = element.find("intensity")
        most = max(color) * (1.0 if strength is None else numbers(strength, str(self.path), (1,))[0])
        light: dict[str, Any] = {
            "direction": P.rotate(pose[3:], np.array(ahead)).tolist(),
            "color": [v / max(color) for v in color] if max(color) > 0 else [1.0, 1.0, 1.0],
            "intensity": most,
        }
        if element.get("type") != "directional":
            light["position"] = pose[:3].tolist()
        self._put(("world", "lights", self._name(element.get("name") or "", "light", taken)), light, element)

    # ------------------------------------------------------------------ ground and objects

    def _is_ground(self, name: str, element: Any) -> bool:
        """Whether a model is static and its one link collides as a level plane at height 0."""
        planes = element.findall("link/collision/geometry/plane")
        if len(planes) != 1 or len(element.findall("link/collision")) != 1 or not self.models[name].fixed:
            return False
        link, collision = element.find("link"), element.find("link/collision")
        pose = P.compose(self.frames.of(f"{name}::{link.get('name')}"), pose_of(collision, str(self.path))[0])
        normal = planes[0].find("normal")
        up = (0.0, 0.0, 1.0) if normal is None else numbers(normal, str(self.path), (3,))
        turned = P.rotate(pose[3:], np.array(up))
        return abs(float(turned[2]) - float(np.linalg.norm(up))) < 1e-9 and abs(float(pose[2])) < 1e-12

    def _terrain(self, element: Any) -> dict[str, Any]:
        terrain: dict[str, Any] = {"kind": "plane"}
        friction = element.find("link/collision/surface/friction/ode/mu")
        color = element.find("link/visual/material/diffuse")
        if friction is not None:
            terrain["friction"] = numbers(friction, str(self.path), (1,))[0]
        if color is not None:
            terrain["color"] = self._color(color)
        return terrain

    def _object(self, name: str, model: SdfModel, link: str, taken: list[str]) -> None:
        element = self.file.models[name]
        if not self._solid(model, link):
            text = "has no shape, and is left out"
            self.notes.append(ImportNote("dropped", f"link '{link}' of model '{name}'", text))
            return
        part = name if len(model.roots) == 1 else f"{name}::{link}"
        here = self._name(part, "model", taken)
        fixed = model.fixed if len(model.roots) == 1 else model.static or (model.fixed and link == WORLD)
        pose = self.frames.of(name)
        if link != WORLD:
            pose = P.compose(pose, model.frames.of(link))
        self._put(("world", "objects", here), {"source": {"asset": f"{self.uri}#{PART}{part}"}}, element)
        if fixed:
            self._put(("world", "objects", here, "fixed"), True, element)
        self._put(("world", "layout", here), placed(pose[:3], pose[3:]), element)

    def _solid(self, model: SdfModel, root: str) -> bool:
        """Whether a tree has a mass, or anything that is seen or touched."""
        own = {root}
        for _ in model.joints:
            own |= {joint.child for joint in model.joints if joint.parent in own}
        return any(model.links[link].visuals or model.links[link].collisions for link in own) or not model.fixed
