"""Notes of what an MJCF file says and the neutral model does not hold.

`anysim_mujoco.mjcf.coverage` has the fate of every field of MuJoCo's elements. One that is left out, or that the table
does not know, becomes a note where it is not at its default, so that none is dropped in silence, whatever a later
MuJoCo adds; one that is approximated where that matters.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import mujoco
import numpy as np

from anysim.assets.model import Fate, ImportNote
from anysim.errors import listing
from anysim_mujoco.mjcf.compliance import mixed
from anysim_mujoco.mjcf.coverage import BOOKKEEPING, FIELDS, fate, whole

PARTLY: Mapping[tuple[str, str], Callable[[Any], str]] = {
    ("geom", "solref"): lambda geom: _solref(geom.solref),
    ("geom", "contype"): lambda geom: _masked(geom),
    ("geom", "conaffinity"): lambda geom: "",  # with contype
    ("joint", "damping"): lambda joint: _polynomial(joint, "damping"),
    ("joint", "stiffness"): lambda joint: _polynomial(joint, "stiffness"),
    ("joint", "solref_limit"): lambda joint: _solref(joint.solref_limit),
    ("joint", "solref_friction"): lambda joint: _solref(joint.solref_friction),
    ("joint", "actfrcrange"): lambda joint: _lopsided(joint.actfrcrange),
    ("actuator", "forcerange"): lambda drive: _lopsided(drive.forcerange),
    ("actuator", "ctrlrange"): lambda drive: _lopsided(drive.ctrlrange) if _motor(drive) else "",
    ("tendon", "damping"): lambda tendon: _polynomial(tendon, "damping"),
    ("tendon", "stiffness"): lambda tendon: _polynomial(tendon, "stiffness"),
    ("tendon", "solref_limit"): lambda tendon: _solref(tendon.solref_limit),
    ("tendon", "solref_friction"): lambda tendon: _solref(tendon.solref_friction),
    ("equality", "solref"): lambda tie: _solref(tie.solref),
    ("equality", "active"): lambda tie: "" if tie.active else "is inactive, and left out",
    ("key", "qpos"): lambda key: "" if key.name == "home" else "are not kept: only the keyframe 'home' is",
    ("key", "mpos"): lambda key: "" if key.name == "home" else "are not kept: only the keyframe 'home' is",
    ("key", "mquat"): lambda key: "" if key.name == "home" else "are not kept: only the keyframe 'home' is",
}
"""Of fields that are approximated, what is not read of an element; empty where all is. Others are noted elsewhere."""

WHOLE = "texture skin camera light numeric text tuple plugin".split()
"""The elements that are left out with a note each; tendons, flexes, sensors and pairs have words of their own."""

OF_SCENE = tuple("option texture skin material camera light key numeric text tuple plugin".split())
WORLD_OPTIONS = ("timestep", "gravity", "cone", "impratio")
"""What of a file's options the `physics` of a world of it has."""
_EARLY = ("texture", "skin", "material", "camera", "light")


def early(spec: mujoco.MjSpec) -> list[ImportNote]:
    """Notes of elements that are taken out before the file is compiled."""
    return [note for kind in _EARLY for note in _of_kind(spec, kind)]


def late(spec: mujoco.MjSpec) -> list[ImportNote]:
    """Notes of all others, and of the options."""
    kinds = [kind for kind in (*FIELDS, *WHOLE) if kind not in (*_EARLY, "option")]
    return [*_options(spec), *(note for kind in kinds for note in _of_kind(spec, kind))]


def of_part(spec: mujoco.MjSpec, world: bool) -> list[ImportNote]:
    """Notes of one part of a scene; with `world` also of what is fixed to the world."""
    kinds = [kind for kind in (*FIELDS, *WHOLE) if kind not in OF_SCENE]
    return [note for kind in dict.fromkeys(kinds) for note in _of_kind(spec, kind, world)]


def of_scene(spec: mujoco.MjSpec) -> list[ImportNote]:
    """Notes of what a file says of the whole scene, but for those of `early`."""
    kinds = [kind for kind in OF_SCENE if kind not in ("option", *_EARLY)]
    return [*_options(spec, WORLD_OPTIONS), *(note for kind in kinds for note in _of_kind(spec, kind))]


def fields_of(element: Any) -> list[str]:
    """The fields of an element of MuJoCo that a file can set."""
    names = [name for name in dir(element) if not name.startswith("_") and name not in BOOKKEEPING]
    return [name for name in names if not callable(getattr(element, name))]


def pristine(kind: str) -> Any:
    """A new element with MuJoCo's defaults."""
    spec = mujoco.MjSpec()
    if kind in ("body", "joint", "geom", "site", "camera", "light"):
        body = spec.worldbody.add_body()
        return body if kind == "body" else getattr(body, f"add_{kind}")()
    return getattr(spec, f"add_{kind}")()


def _of_kind(spec: mujoco.MjSpec, kind: str, world: bool = False) -> Iterator[ImportNote]:
    plural = {"body": "bodies", "mesh": "meshes", "equality": "equalities"}.get(kind, f"{kind}s")
    elements = [one for one in getattr(spec, plural) if (world and kind != "body") or not _of_the_world(kind, one)]
    if not elements:
        return
    if kind in WHOLE and (row := whole(kind)) is not None:
        yield ImportNote("dropped", f"{kind}s", _named(elements, f"are left out: {row.text}"))
        return
    fresh = pristine(kind)
    for field in fields_of(fresh):
        row, partly = fate(kind, field), PARTLY.get((kind, field))
        if row is not None and row.fate is not Fate.LEFT_OUT and partly is None:
            continue
        usual = value_of(fresh, field)
        told: dict[str, list[Any]] = {}
        for one in elements:
            value = value_of(one, field)
            if value == usual and (kind, field) not in {("equality", "active"), ("geom", "contype")}:
                continue
            effect = _left_out(kind, field, value) if partly is None else partly(one)
            if effect:
                told.setdefault(effect, []).append(one)
        for effect, ones in told.items():
            yield ImportNote("dropped", f"{kind} {field}", _named(ones, effect))
    if kind == "joint":
        yield from _of_free_joints(elements)


def _of_the_world(kind: str, element: Any) -> bool:
    """Whether it is the world's body, or fixed to it: that is left out as a whole."""
    return element.name == "world" if kind == "body" else kind in ("geom", "site") and element.parent.name == "world"


def _of_free_joints(joints: Iterable[Any]) -> Iterator[ImportNote]:
    free = [joint for joint in joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]
    for field in ("damping", "armature", "frictionloss", "stiffness"):
        ones = [joint for joint in free if any(_numbers(getattr(joint, field)))]
        if ones:
            yield ImportNote("dropped", f"joint {field}", _named(ones, "a free joint has none here"))


def _options(spec: mujoco.MjSpec, held: Iterable[str] = ()) -> Iterator[ImportNote]:
    fresh, own = mujoco.MjSpec().option, spec.option
    for field in (one for one in fields_of(fresh) if one not in held):
        value = value_of(own, field)
        if value == value_of(fresh, field):
            continue
        if field in ("disableflags", "enableflags"):
            kind = mujoco.mjtDisableBit if field == "disableflags" else mujoco.mjtEnableBit
            named = {name.partition("_")[2].lower(): int(bit) for name, bit in kind.__members__.items() if "_" in name}
            flags = ", ".join(name for name, bit in named.items() if value & bit)
            why = "the world's `physics` has gravity, the others" if "gravity" in flags else "they"
            yield ImportNote("dropped", f"option flag {field[:-5]}", f"{flags}: is left out: {why} are MuJoCo's alone")
        else:
            yield ImportNote("dropped", f"option {field}", _left_out("option", field, value))


def value_of(element: Any, field: str) -> Any:
    """The value of a field as plain data, equal where it means the same."""
    value = getattr(element, field)
    if isinstance(value, str | bool | int):
        return value
    if hasattr(value, "plugin_name"):
        return (value.name, value.plugin_name, bool(value.active))
    numbers = _numbers(value)
    return tuple("unset" if isinstance(v, float) and v != v else v for v in numbers)


def _numbers(value: Any) -> tuple[Any, ...]:
    try:
        return tuple(value.tolist() if hasattr(value, "tolist") else value)
    except TypeError:
        return (value,)


def _left_out(kind: str, field: str, value: Any) -> str:
    row = fate(kind, field)
    effect = "" if row is None else row.text
    shown = " ".join(f"{v:g}" if isinstance(v, float) else str(v) for v in value) if isinstance(value, tuple) else value
    shown = str(shown)
    return f"{shown if len(shown) <= 40 else shown[:37] + '…'} is left out" + (f": {effect}" if effect else "")


def _named(elements: list[Any], effect: str) -> str:
    names = [one.name for one in elements if one.name]
    who = listing(names, 3) if names else "without a name"
    return f"{effect} ({len(elements)}: {who})"


def of_tendons(model: Any) -> Iterator[ImportNote]:
    """Notes of the tendons of a compiled file that are left out: those that only measure."""
    idle = [model.tendon(t) for t in range(model.ntendon) if not tendon_effects(model, t)]
    if idle:
        yield ImportNote("info", "tendons", _named(idle, "do nothing in the file either: they only measure"))


def is_fixed(model: Any, t: int) -> bool:
    """Whether tendon `t` of a compiled file is a sum of joint positions, not a path through space."""
    first = int(model.tendon_adr[t])
    kinds = model.wrap_type[first : first + int(model.tendon_num[t])]
    return bool(np.all(kinds == int(mujoco.mjtWrap.mjWRAP_JOINT)))


def tendon_effects(model: Any, t: int) -> list[str]:
    """What tendon `t` of a compiled file does to its joints and bodies; empty where it only measures."""
    fields = {"stiffness": "pull as springs", "damping": "damp", "frictionloss": "rub", "armature": "add inertia"}
    found = [words for field, words in fields.items() if np.any(getattr(model, f"tendon_{field}")[t])]
    if model.tendon_limited[t]:
        found.append("limit a length")
    drives = np.asarray(model.actuator_trntype) == int(mujoco.mjtTrn.mjTRN_TENDON)
    if np.any(drives & (np.asarray(model.actuator_trnid)[:, 0] == t)):
        found.append("carry the force of drives")
    ties = np.asarray(model.eq_type) == int(mujoco.mjtEq.mjEQ_TENDON)
    if np.any(ties & ((np.asarray(model.eq_obj1id) == t) | (np.asarray(model.eq_obj2id) == t))):
        found.append("are tied to a length")
    return found


# ------------------------------------------------------------------ fields that are read in part


def _solref(value: Any) -> str:
    return f"{value[0]:g} {value[1]:g} mixes two forms: the default holds, as in MuJoCo" if mixed(value) else ""


def _masked(geom: Any) -> str:
    kept = geom.contype or geom.conaffinity
    if not kept or (geom.contype & 1 and geom.conaffinity & 1):
        return ""
    return f"{geom.contype} and conaffinity {geom.conaffinity} hold inside of the model; it meets all that is not of it"


def _polynomial(joint: Any, field: str) -> str:
    more = tuple(getattr(joint, field)[1:])
    return f"is a polynomial; its linear part alone is kept, without {more[0]:g} {more[1]:g}" if any(more) else ""


def _lopsided(limits: Any) -> str:
    low, high = (float(v) for v in limits)
    return "" if low == -high else f"[{low:g}, {high:g}] is one-sided; the larger end limits both"


def _motor(drive: Any) -> bool:
    """Whether a control is an effort, and bounded: nothing, or only a constant, is added to it."""
    constant = drive.biastype == mujoco.mjtBias.mjBIAS_AFFINE and not drive.biasprm[1:3].any()
    return (drive.biastype == mujoco.mjtBias.mjBIAS_NONE or constant) and bool(drive.ctrllimited)
