"""Objects and robots as strands-robots describes them, in the words of a world."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.errors import EngineError, PluginError, listing, suggest
from anysim.math.arrays import numbers, shown

SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh")
ALIASES = {"panda": "franka_panda", "g1": "unitree_g1", "go1": "unitree_go1", "go2": "unitree_go2", "a1": "unitree_a1"}
"""Their names of robots that the catalogue has under another one."""
HOME = "home"
"""The keyframe that every robot of the catalogue has: its home positions."""


def finite(name: str, value: Any) -> Array:
    """Finite numbers, of any shape.

    Raises:
        EngineError: they are none.
    """
    found = numbers(name, value, EngineError)
    if not np.isfinite(found).all():
        raise EngineError(f"{name} takes finite numbers, got {shown(value)}")
    return found


def vector(name: str, value: Any, count: int) -> list[float]:
    """So many finite numbers.

    Raises:
        EngineError: they are none.
    """
    found = finite(name, value)
    if found.shape != (count,):
        raise EngineError(f"{name} are {count} finite numbers, got {shown(value)}")
    return [float(x) for x in found]


def place(position: Any, orientation: Any) -> dict[str, Any]:
    """The fields of a live edit for a position [m] and an orientation w, x, y, z, where they are given."""
    fields: dict[str, Any] = {}
    if position is not None:
        fields["position"] = vector("position", position, 3)
    if orientation is not None:
        w, x, y, z = vector("orientation", orientation, 4)
        length = float(np.linalg.norm([w, x, y, z]))
        if length < 1e-6:
            raise EngineError("orientation is a quaternion w, x, y, z, which is not zero")
        fields["quaternion"] = [x / length, y / length, z / length, w / length]
    return fields


def object_fields(
    shape: str, size: Any, color: Any, mass: Any, is_static: Any, mesh_path: str | None, material: Any
) -> dict[str, Any]:
    """An `objects` entry: `size` holds full extents [m] along x, y and z, as their first backend reads it.

    A sphere reads the first as its diameter; cylinders and capsules the first as diameter and the third as height (of a
    capsule's straight part).

    Raises:
        EngineError: something that cannot be held.
    """
    if shape not in SHAPES:
        raise EngineError(f"shape '{shape}' cannot be made{suggest(shape, SHAPES)} (shapes: {listing(SHAPES)})")
    if material is not None:
        raise EngineError("material cannot be given here; a load_scene file can describe materials and textures")
    if is_static is not None and not isinstance(is_static, bool | np.bool_):
        raise EngineError(f"is_static is true, false or not given, got {shown(is_static)}")
    fields: dict[str, Any] = {"source": _source(shape, size, mesh_path), "fixed": bool(is_static)}
    weight = finite("mass", mass)
    if weight.shape != () or isinstance(mass, bool) or weight <= 0:
        raise EngineError(f"mass is a finite number greater than 0 [kg], got {shown(mass)}")
    fields["mass"] = float(weight)
    if color is not None:
        found = finite("color", color)
        if found.shape == (4,) and found[3] != 1:
            raise EngineError(f"color has an alpha of {found[3]:g}; nothing is transparent here: give 3 numbers, or 1")
        if found.shape not in ((3,), (4,)) or found.min() < 0 or found.max() > 1:
            raise EngineError(f"color is red, green, blue (and alpha) in [0, 1], got {shown(color)}")
        fields["color"] = [float(c) for c in found[:3]]
    return fields


def _source(shape: str, size: Any, mesh_path: str | None) -> dict[str, Any]:
    if shape == "mesh":
        if not mesh_path:
            raise EngineError("shape 'mesh' needs mesh_path")
        return {"mesh": str(Path(mesh_path).absolute())}
    if mesh_path is not None:
        raise EngineError(f"mesh_path goes with shape 'mesh', not with '{shape}'")
    if size is None:
        size = [0.05, 0.05, 0.05]
    found = finite("size", size)
    least = 1 if shape == "sphere" else 3
    if found.ndim != 1 or not least <= len(found) <= 3 or found.min() <= 0:
        raise EngineError(f"size of a {shape} is {least} to 3 lengths [m] greater than 0, got {shown(size)}")
    if shape == "box":
        return {"box": [float(x) for x in found]}
    if shape == "sphere":
        return {"sphere": float(found[0]) / 2}
    return {shape: [float(found[0]) / 2, float(found[2])]}


def robot_model(name: str, urdf_path: str | None, data_config: str | None) -> str:
    """The catalogue's name of a robot; or the YAML entry of a model file, drafted where the file has none.

    Raises:
        PluginError: the catalogue has no such robot; lists those that it has.
        AssetError: the file cannot be read.
    """
    if urdf_path is not None:
        if urdf_path.endswith((".yaml", ".yml")):
            return str(Path(urdf_path).absolute())
        return _drafted(Path(urdf_path))
    asked = data_config or name
    known = sorted(registry.names("robots"))
    found = asked if asked in known else ALIASES.get(asked, asked)
    if found not in known:
        raise PluginError(
            f"the catalogue has no robot '{asked}'{suggest(asked, known)}; name one as data_config, or give the URDF "
            f"or MJCF file of another as urdf_path (robots: {listing(known, 60)})"
        )
    return found


def _drafted(file: Path) -> str:
    from anysim_robots.drafting.draft import draft

    made = draft(file)
    folder = Path(tempfile.mkdtemp(prefix="anysim_robot_"))
    entry = folder / f"{made.name}.yaml"
    entry.write_text(made.text(folder))
    return str(entry)


def keyframe_fields(keyframe: str | int | None, urdf_path: str | None) -> dict[str, Any]:
    """The `home` of a robot for a keyframe; none where the robot's own is meant.

    Raises:
        EngineError: there is no such keyframe; lists those that there are.
    """
    if keyframe is None or (urdf_path is None and keyframe in (HOME, 0)):
        return {}
    names: Sequence[str] = [HOME]
    if urdf_path is not None and urdf_path.endswith(".xml"):
        from anysim_mujoco.mjcf.keyframes import keyframes

        found: Mapping[str, Mapping[str, float]] = keyframes(Path(urdf_path))
        names = list(found)
        if isinstance(keyframe, int) and not isinstance(keyframe, bool) and 0 <= keyframe < len(names):
            keyframe = names[keyframe]
        if keyframe in found:
            return {"home": dict(found[keyframe])}
    raise EngineError(f"there is no keyframe {keyframe!r} (keyframes: {listing(names) or 'none'})")
