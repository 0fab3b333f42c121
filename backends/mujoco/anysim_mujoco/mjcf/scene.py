"""Whole MJCF files as worlds: their bodies as objects, with their places, lights, cameras, ground and physics.

- What is fixed to the world is one object, a level plane at height 0 the ground, each body of the world another object,
  fixed unless it floats. Where they begin is what a keyframe `home` says, else the file's own places.
- Trees of which no geom may meet any of another's never collide. Drives are left out: an object's joints have none.
- Lights and cameras that follow something stay as they are at first.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from anysim import registry
from anysim.assets.bounded_files import check, xml_root
from anysim.assets.scene import PART, control_step, free_name, placed
from anysim.conventions import GROUND, Array
from anysim.errors import listing
from anysim.math import pose as P
from anysim_mujoco.mjcf.file import compile_noting, opened
from anysim_mujoco.mjcf.geoms import pose_of
from anysim_mujoco.mjcf.load import import_mjcf
from anysim_mujoco.mjcf.pairs import of_pairs
from anysim_mujoco.mjcf.part import bodies_of, ground_of, owner_of
from anysim_mujoco.mjcf.sensors import body_of, tag_of
from anysim_mujoco.mjcf.unheld import of_scene, value_of
from anysim_schemas.limits import SCENE_PARTS
from anysim_schemas.scene import ImportedScene, SceneEntry, SceneNote

SURROUNDINGS = "surroundings"
"""The name of the object that has all that is fixed to the world."""
_OPTICAL = np.array([1.0, 0.0, 0.0, 0.0])  # from x right, y up, z back to x right, y down, z ahead
_FIXED = mujoco.mjtCamLight.mjCAMLIGHT_FIXED
_LIGHT = {
    "specular": "highlights are the materials'",
    "attenuation": "lights reach everywhere",
    "cutoff": "lights are no cones",
    "exponent": "lights are no cones",
    "ambient": "the world's `scenery` has it",
    "castshadow": "the world's `scenery` has it",
    "bulbradius": "shadows are as the engine has them",
    "range": "lights reach everywhere",
    "intensity": "`diffuse` is read",
    "texture": "lights are plain",
}
_CAMERA = {
    "ipd": "there is one eye",
    "intrinsic": "`fovy` is read",
    "focal_length": "`fovy` is read",
    "focal_pixel": "`fovy` is read",
    "principal_length": "images have their axis in their middle",
    "principal_pixel": "images have their axis in their middle",
    "sensor_size": "`fovy` is read",
    "output": "`channels` says what it takes",
    "proj": "cameras see in perspective",
}


def read_mjcf_scene(path: Path, *, root: Path, uri: str, packages: Mapping[str, Path]) -> ImportedScene:
    """What an MJCF file says of a run; see `anysim.assets.scene`.

    Raises:
        AssetError: see `anysim_mujoco.mjcf.file.compiled`.
    """
    del packages  # MJCF refers to files alone
    with opened(path, root) as (spec, said):
        notes = [note for note in said if note.where.partition(" ")[0] not in ("light", "lights", "camera", "cameras")]
        bodies = bodies_of(spec)
        check(path, SCENE_PARTS, len(bodies))
        notes += of_scene(spec)
        model = compile_noting(spec, notes)
        notes += of_pairs(model)
        told: list[SceneNote] = [(n.kind, n.where, n.message) for n in notes]
        return _Scene(path, root, uri, spec, bodies, model, told).read()


@dataclass
class _Scene:
    path: Path
    root: Path
    uri: str
    spec: Any
    bodies: Mapping[str, Any]
    model: Any
    notes: list[SceneNote]
    entries: list[SceneEntry] = field(default_factory=list)
    names: dict[str, str] = field(default_factory=dict)
    """Of parts: their objects."""

    def read(self) -> ImportedScene:
        self.data = mujoco.MjData(self.model)
        home = [k for k in range(self.model.nkey) if self.model.key(k).name == "home"]
        if home:
            mujoco.mj_resetDataKeyframe(self.model, self.data, home[0])
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        self.ground = ground_of(self.model)
        self._physics()
        self._ground()
        for part in [*([""] if self._has_fixed() else []), *self.bodies]:
            self._object(part)
        self._lights()
        self._cameras()
        self._sensors()
        self._apart()
        return ImportedScene(tuple(self.entries), tuple(self.notes))

    def _put(self, keys: tuple[str, ...], value: Any, element: Any = None, line: int = 1) -> None:
        if element is not None and (found := re.search(r"line (\d+)", element.info)):
            line = int(found[1])
        self.entries.append(SceneEntry(keys, value, str(self.path), line))

    def _note(self, kind: Any, where: str, message: str) -> None:
        self.notes.append((kind, where, message))

    def _name(self, wanted: str, otherwise: str, taken: Any) -> str:
        """A name that anysim takes, made of one that MuJoCo takes."""
        free = free_name(wanted, otherwise, taken)
        if wanted and free != wanted:
            self._note("info", f"{otherwise} '{wanted}'", f"is called '{free}' here")
        return free

    # ------------------------------------------------------------------ physics and ground

    def _physics(self) -> None:
        option, elements = self.spec.option, xml_root(self.path)[0].findall("option")
        line = elements[0].sourceline if elements else 1
        off = int(option.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
        dt = float(option.timestep)
        values = {
            "gravity": [0.0, 0.0, 0.0] if off else [float(v) for v in option.gravity],
            "dt": dt,
            "control_dt": control_step(dt),
            "friction_cone": "elliptic" if option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC else "pyramidal",
            "impratio": float(option.impratio),
        }
        for key, value in values.items():
            self._put(("physics", key), value, line=line)
        if re.fullmatch(r"[a-zA-Z][a-zA-Z0-9_]*", self.spec.modelname):
            self._put(("world", "name"), self.spec.modelname)

    def _ground(self) -> None:
        number = self.ground
        if number < 0:
            self._put(("world", "terrain"), {"kind": "none"})
            return
        element = next(geom for geom in self.spec.worldbody.geoms if geom.id == number)
        material = int(self.model.geom_matid[number])
        plain = np.allclose(self.model.geom_rgba[number], 0.5 + 0.5 * np.eye(4)[3])
        rgba = self.model.mat_rgba[material] if material >= 0 and plain else self.model.geom_rgba[number]
        color = [round(float(np.clip(v, 0.0, 1.0)), 6) for v in rgba[:3]]
        terrain = {"kind": "plane", "friction": float(self.model.geom_friction[number][0]), "color": color}
        self._put(("world", "terrain"), terrain, element)
        fresh = mujoco.MjSpec().worldbody.add_geom()
        for key in ("solref", "solimp", "condim", "priority", "margin", "gap"):
            if value_of(element, key) != value_of(fresh, key):
                self._note(
                    "dropped",
                    f"geom '{element.name or number}' of the world",
                    f"its {key} is left out: it is the ground",
                )

    def _has_fixed(self) -> bool:
        return bool(self.model.body_geomnum[0] > (self.ground >= 0) or np.any(self.model.site_bodyid == 0))

    # ------------------------------------------------------------------ objects

    def _object(self, part: str) -> None:
        element = self.bodies.get(part)
        number = 0 if element is None else element.id
        name = self._name(self._owner(part) or SURROUNDINGS, "body", [*self.names.values(), GROUND])
        self.names[part] = name
        joints = range(self.model.body_jntadr[number], self.model.body_jntadr[number] + self.model.body_jntnum[number])
        free = any(self.model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE for j in joints)
        place = self._pose(number) if free or not joints else pose_of(np.zeros(3), np.eye(4)[0], 1.0)
        self._put(("world", "objects", name), {"source": {"asset": f"{self.uri}#{PART}{part}"}}, element)
        if not free:
            self._put(("world", "objects", name, "fixed"), True, element)
        self._put(("world", "layout", name), placed(place[:3], place[3:]), element)

    def _owner(self, part: str) -> str:
        """What a part is called after: the bodies of an entity that was written begin with its name."""
        if not part or not self.bodies[part].name:
            return part
        top = self.bodies[part].id
        inside = np.flatnonzero(self.model.body_rootid == top)
        return owner_of(part, [self.model.body(int(number)).name for number in inside])

    def _pose(self, number: int) -> Array:
        return pose_of(self.data.xpos[number], self.data.xquat[number], 1.0)

    # ------------------------------------------------------------------ lights and cameras

    def _lights(self) -> None:
        taken: list[str] = []
        for element in self.spec.lights:
            number = element.id
            where = f"light '{element.name or number}'"
            self._said(element, "light", _LIGHT, where)
            if not element.active:
                self._note("dropped", where, "is off, and left out")
                continue
            if self.model.light_bodyid[number] or element.mode != _FIXED:
                self._note("dropped", where, "moves in the file; it stays where it is at first")
            diffuse = np.clip(np.asarray(element.diffuse, dtype=float), 0.0, None)
            most = float(diffuse.max())
            light: dict[str, Any] = {
                "direction": self.data.light_xdir[number].tolist(),
                "color": [1.0, 1.0, 1.0] if most == 0 else (diffuse / most).round(7).tolist(),
                "intensity": round(most, 7),
            }
            if element.type != mujoco.mjtLightType.mjLIGHT_DIRECTIONAL:
                light["position"] = self.data.light_xpos[number].tolist()
            taken.append(self._name(element.name, "light", taken))
            self._put(("world", "lights", taken[-1]), light, element)

    def _cameras(self) -> None:
        taken: list[str] = []
        for element in self.spec.cameras:
            number, where = element.id, f"camera '{element.name or element.id}'"
            body = int(self.model.cam_bodyid[number])
            self._said(element, "camera", _CAMERA, where)
            if element.mode != _FIXED:
                self._note("dropped", where, "follows a body in the file; it is fixed to the body that carries it")
            camera: dict[str, Any] = {"fov": float(self.model.cam_fovy[number])}
            width, height = (int(v) for v in self.model.cam_resolution[number])
            if min(width, height) > 1:
                camera["size"] = [width, height]
            pose = pose_of(self.model.cam_pos[number], self.model.cam_quat[number], 1.0)
            pose[3:] = P.multiply(pose[3:], _OPTICAL)
            camera |= self._view(body, pose, where)
            taken.append(self._name(element.name, "camera", taken))
            self._put(("world", "cameras", taken[-1]), camera, element)

    def _view(self, body: int, pose: Array, where: str) -> dict[str, Any]:
        """Where a camera is, and where it looks to: fixed to a body, or in the world."""
        fixed = {"position": pose[:3].tolist(), "roll_pitch_yaw": P.exact_roll_pitch_yaw(pose[3:]).tolist()}
        if body:
            top = int(self.model.body_rootid[body])
            part = next(part for part, element in self.bodies.items() if element.id == top)
            link = self.model.body(body).name or f"body{body}"
            owner = self.names[part]
            own = self._owner(part)
            mount = owner if link == own and self._still(top) else f"{owner}.{link.removeprefix(f'{own}.')}"
            return {"mount": mount, **fixed}
        ahead = P.rotate(pose[3:], np.array([0.0, 0.0, 1.0]))
        target = pose[:3] + ahead
        if float(P.angle_between(P.look_at(pose[:3], target), pose[3:])) > 1e-6:
            if "" in self.names:
                return {"mount": self.names[""], **fixed}
            self._note("dropped", where, "is turned about its axis; here its images are upright")
        return {"from": pose[:3].tolist(), "look_at": target.tolist()}

    def _still(self, top: int) -> bool:
        first, count = int(self.model.body_jntadr[top]), int(self.model.body_jntnum[top])
        return not count or self.model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE

    def _said(self, element: Any, kind: str, fields: Mapping[str, str], where: str) -> None:
        """Notes of what an element says that a light or a camera of anysim has not."""
        fresh = getattr(mujoco.MjSpec().worldbody, f"add_{kind}")()
        for key, why in fields.items():
            if value_of(element, key) != value_of(fresh, key):
                self._note("dropped", where, f"its {key} is left out: {why}")

    # ------------------------------------------------------------------ sensors

    def _sensors(self) -> None:
        """Those of each part, whose importer knows what its frames are called; of the others that they are not."""
        model, there, alone, taken = self.model, set(registry.names("sensors")), list[str](), list[str]()
        on = [int(model.body_rootid[body]) if (body := body_of(model, s)) >= 0 else -1 for s in range(model.nsensor)]
        for part, owner in self.names.items():
            if (self.bodies[part].id if part else 0) not in on:
                continue
            read = import_mjcf(self.path, root=self.root, body=f"{PART}{part}")
            for hint in read.sensors:
                frame = owner if hint.frame in ("", read.bodies[0].name) else f"{owner}.{hint.frame}"
                if hint.kind not in there:
                    alone.append(hint.name)
                    continue
                name = self._name(hint.name, hint.kind, taken)
                taken.append(name)
                element = next((one for one in self.spec.sensors if one.name == hint.sources[0]), None)
                self._put(("world", "sensors", name), {"sensor": hint.kind, "frame": frame, **hint.params}, element)
        if alone:
            text = f"are left out: no installed sensor reads them ({len(alone)}: {listing(alone, 3)})"
            self._note("dropped", "sensors", text)
        if rest := [model.sensor(s).name or tag_of(model, s) for s, root in enumerate(on) if root < 0]:
            self._note("dropped", "sensors", f"on no body are left out ({len(rest)}: {listing(rest, 3)})")

    # ------------------------------------------------------------------ collisions

    def _apart(self) -> None:
        """Pairs of things of which no geom may meet one of the other, by the file's masks and excluded bodies."""
        model = self.model
        own: dict[str, list[tuple[int, int, int]]] = {name: [] for name in (*self.names.values(), GROUND)}
        number = {self.bodies[part].id: name for part, name in self.names.items() if part}
        for g in range(model.ngeom):
            top = int(model.body_rootid[model.geom_bodyid[g]])
            name = GROUND if g == self.ground else number.get(top, self.names.get("", ""))
            own[name].append((int(model.geom_contype[g]), int(model.geom_conaffinity[g]), int(model.geom_bodyid[g])))
        barred = {tuple(sorted((int(s) >> 16, int(s) & 0xFFFF))) for s in model.exclude_signature}
        still = {name for name, value in self._fixed_ones() if value}
        pairs: list[list[str]] = []
        partly: dict[str, list[str]] = {}
        for one, other in combinations(own, 2):
            if {one, other} <= still:
                continue
            touching = [[geom for geom in own[name] if geom[0] | geom[1]] for name in (one, other)]
            masks = {tuple(g) for g in touching[0]}, {tuple(g) for g in touching[1]}
            meet = {
                bool((a[0] & b[1]) | (b[0] & a[1])) and tuple(sorted((a[2], b[2]))) not in barred
                for a in masks[0]
                for b in masks[1]
            }
            if meet == {False}:
                pairs.append([one, other])
            elif False in meet:
                partly.setdefault(one, []).append(other)
        for one, others in partly.items():
            text = f"some of them pass through some of {listing(others, 3)} in the file; here all meet"
            self._note("dropped", f"geoms of '{one}'", text)
        if pairs:
            self._put(("world", "collisions", "exclude"), pairs)

    def _fixed_ones(self) -> list[tuple[str, bool]]:
        found = [(GROUND, True)]
        for part, name in self.names.items():
            found.append((name, not part or not int(self.model.body_weldid[self.bodies[part].id])))
        return found
