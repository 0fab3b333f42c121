"""Sensors of an MJCF file as those that worlds declare, and which of them there are none for.

Several of a file are one here where a device has them together: an accelerometer and a gyro of a site are an IMU.
"""

from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import mujoco
import numpy as np

from anysim.assets.model import Fate, ImportNote, SensorHint
from anysim.errors import listing
from anysim_mujoco.mjcf.coverage import sensor_row

KINDS: Mapping[str, str] = MappingProxyType(
    {
        "accelerometer": "imu",
        "gyro": "imu",
        "force": "force_torque",
        "torque": "force_torque",
        "touch": "touch",
        "rangefinder": "lidar",
        "framepos": "tracking",
        "framequat": "tracking",
        "framelinvel": "tracking",
        "frameangvel": "tracking",
    }
)
"""The sensor of a world that reads what one of a file does."""
_ALONE = ("touch", "lidar")
"""Sensors that have one zone or one ray: two of a file are two here."""
_TAGS: Mapping[str, str] = MappingProxyType(
    {
        "jointactfrc": "jointactuatorfrc",
        "tendonactfrc": "tendonactuatorfrc",
        "geomdist": "distance",
        "geomnormal": "normal",
        "geomfromto": "fromto",
    }
)
"""The elements of a file that MuJoCo calls otherwise."""
_SITE, _BODY, _XBODY = mujoco.mjtObj.mjOBJ_SITE, mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_XBODY
_ZONES = {
    mujoco.mjtGeom.mjGEOM_BOX: ("box", (2.0, 2.0, 2.0)),
    mujoco.mjtGeom.mjGEOM_SPHERE: ("sphere", (1.0,)),
    mujoco.mjtGeom.mjGEOM_CYLINDER: ("cylinder", (1.0, 2.0)),
    mujoco.mjtGeom.mjGEOM_CAPSULE: ("capsule", (1.0, 2.0)),
}
"""Shapes of sites, and what of their half sizes their size here is."""
FAR = 100.0
"""[m] What a ray reads that meets nothing, where the file has no end of its range."""


def tag_of(model: Any, number: int) -> str:
    """The element that a sensor of a compiled file was."""
    name = mujoco.mjtSensor(int(model.sensor_type[number])).name.removeprefix("mjSENS_").lower()
    return _TAGS.get(name, name)


def body_of(model: Any, number: int) -> int:
    """The body of a compiled file that a sensor is on; -1 for one that is on no site and on no body."""
    kind, at = int(model.sensor_objtype[number]), int(model.sensor_objid[number])
    if kind == _SITE:
        return int(model.site_bodyid[at])
    return at if kind in (_BODY, _XBODY) else -1


class _One(NamedTuple):
    """A sensor of a file that one of a world reads."""

    name: str
    kind: str
    frame: str
    params: dict[str, Any]


class SensorReader:
    """Reads the sensors of one model.

    `sites` and `links` are the names of its frames by the numbers of MuJoCo's sites and bodies, `joined` the bodies of
    the file that are one with others here, `scale` that of all lengths.
    """

    def __init__(
        self, model: Any, sites: Mapping[int, str], links: Sequence[str], joined: frozenset[int], scale: float
    ) -> None:
        self._model, self._sites, self._links = model, sites, links
        self._joined, self._scale = joined, scale

    def read(self) -> tuple[list[SensorHint], list[ImportNote]]:
        """The sensors of a world that the file has, and what is lost of them and of the others."""
        found: list[_One] = []
        told: dict[str, list[str]] = {}
        for number in range(self._model.nsensor):
            own, whys = self._one(number)
            found += [] if own is None else [own]
            for why in whys:
                told.setdefault(why, []).append(self._model.sensor(number).name or f"sensor{number}")
        notes = [
            ImportNote("dropped", "sensors", f"{why} ({len(ones)}: {listing(ones, 3)})") for why, ones in told.items()
        ]
        return list(self._grouped(found)), notes

    # ------------------------------------------------------------------ one sensor

    def _one(self, number: int) -> tuple[_One | None, list[str]]:
        """A sensor as one of a world, if there is such; and what is lost of it."""
        model, tag = self._model, tag_of(self._model, number)
        row = sensor_row(tag)
        if row is None or row.fate is Fate.LEFT_OUT:
            return None, [f"a {tag} is left out" + (f": {row.text}" if row is not None and row.text else "")]
        frame, why = self._frame(number, tag)
        params: dict[str, Any] = {}
        if frame is not None and tag == "touch":
            params, why = self._zone(int(model.sensor_objid[number]))
        elif frame is not None and tag == "rangefinder":
            params = self._ray(number)
        elif tag in ("force", "torque"):
            params = {"on": "link"}
        if frame is None or why:
            return None, [f"a {tag} is left out: {why}"]
        lost = []
        if model.sensor_cutoff[number] and tag != "rangefinder":
            lost.append(f"readings of a {tag} have no `cutoff`")
        if model.sensor_noise[number]:
            lost.append("`noise` is left out, as MuJoCo itself adds none; `noise` of a world's sensor has it")
        if model.sensor_delay[number] or np.any(model.sensor_interval[number]) or np.any(model.sensor_history[number]):
            lost.append(
                "`delay`, `nsample`, `interp` and `interval` are left out; `rate` and `delay` of a world have them"
            )
        if tag in ("touch", "rangefinder") and self._body(number) in self._joined:
            seen = "contacts" if tag == "touch" else "the shapes"
            also = "count too" if tag == "touch" else "are not seen either"
            lost.append(f"a {tag} is on a body that is joined rigidly to others: {seen} of those {also}")
        kind = KINDS[tag]
        name = str(model.sensor(number).name)
        return _One(name or f"{kind}{number}", kind, frame, params), lost

    def _body(self, number: int) -> int:
        return body_of(self._model, number)

    def _frame(self, number: int, tag: str) -> tuple[str | None, str]:
        """The frame that a sensor is in, or why it has none."""
        model = self._model
        kind, at, body = int(model.sensor_objtype[number]), int(model.sensor_objid[number]), self._body(number)
        if int(model.sensor_refid[number]) >= 0:
            return None, "it is seen from a frame of the file; `relative_to` of `tracking` has that"
        if kind == _BODY:
            pose = np.array([*model.body_ipos[at], *model.body_iquat[at]])
            if np.abs(pose - [0, 0, 0, 1, 0, 0, 0]).max() > 1e-12:
                return None, "it is of the inertial frame of a body, which is no frame here; `xbody` is one"
        elif kind not in (_SITE, _XBODY):
            return None, "it is on no site and no body"
        if tag in ("force", "torque"):
            first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
            if not count or model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE:
                return None, "no joint is between its body and another, and forces are those that a joint passes"
        elif tag == "touch" and body == 0:
            return None, "it is on no body that something can touch"
        frame = self._sites.get(at) if kind == _SITE else self._links[at] if body else None
        return frame, "" if frame is not None else "it is on nothing of the model"

    def _zone(self, site: int) -> tuple[dict[str, Any], str]:
        kind = mujoco.mjtGeom(int(self._model.site_type[site]))
        if kind not in _ZONES:
            return {}, f"its zone is of type {kind.name.removeprefix('mjGEOM_').lower()}"
        shape, factors = _ZONES[kind]
        size = [
            float(v) * factor * self._scale for v, factor in zip(self._model.site_size[site], factors, strict=False)
        ]
        return {"zone": {shape: size[0] if shape == "sphere" else size}}, ""

    def _ray(self, number: int) -> dict[str, Any]:
        """One ray along the z axis of the site, as far as the file has it."""
        far = float(self._model.sensor_cutoff[number]) or FAR
        turn = [0.0, float(np.pi / 2), 0.0]  # of a turn of one column, which looks back, to a site's z
        pattern = {"kind": "planar", "columns": 1}
        return {"pattern": pattern, "far": far * self._scale, "shapes": "visual", "roll_pitch_yaw": turn}

    # ------------------------------------------------------------------ what a device has together

    def _grouped(self, found: Sequence[_One]) -> Iterator[SensorHint]:
        groups: dict[tuple[str, ...], list[_One]] = {}
        for one in found:
            alone = (one.name,) if one.kind in _ALONE else ()
            groups.setdefault((one.kind, one.frame, *alone), []).append(one)
        for ones in groups.values():
            names = tuple(one.name for one in ones)
            yield SensorHint(_shared(names) or ones[0].frame, ones[0].kind, ones[0].frame, ones[0].params, names)


def _shared(names: Sequence[str]) -> str:
    """What names begin with, up to a word's end: `imu` of `imu_acc` and `imu_gyro`; a single one as it is."""
    if len(set(names)) == 1:
        return names[0]
    size = next(
        (i for i, letters in enumerate(zip(*names, strict=False)) if len(set(letters)) > 1), min(map(len, names))
    )
    begin = names[0][:size]
    words = begin if all(len(name) == size or name[size] in "_-. /" for name in names) else begin.rpartition("_")[0]
    return words.rstrip("_-. /")


def told_of(hints: Sequence[SensorHint]) -> Iterator[ImportNote]:
    """A note of an asset that has them in its file alone."""
    kinds: dict[str, list[str]] = {}
    for hint in hints:
        kinds.setdefault(hint.kind, []).extend(hint.sources)
    for kind, names in kinds.items():
        who = f"({len(names)}: {listing(names, 3)})"
        yield ImportNote("info", "sensors", f"`{kind}`: drafts and scenes have it, an asset has none {who}")
