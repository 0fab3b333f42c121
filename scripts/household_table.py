"""The table of household things in docs/household.md, from docs/household.json, and the page's pictures.

    python scripts/household_table.py [--check]
    python scripts/household_table.py --measure
    python scripts/household_table.py --draw

`--measure` sets all of them down on a floor, 2 mm above it, on each engine, and looks at them after 3 s; it takes a
minute for each engine. `--draw` draws them, those of each file on each engine. `--check` writes nothing and exits with
1 if the page has drifted from the things or from the file, or if one of them did not stay as it was set down.
"""

import hashlib
import json
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from benchmark_table import table
from generated import ROOT, main
from pictures import ENGINES, begun, side_by_side

from anysim.assets.model import ImportedModel
from anysim.assets.procedural import build
from anysim.conventions import Array
from anysim.geometry.bounds import shape_bounds
from anysim.math import pose as P
from anysim.record.commit import write_whole
from anysim_household.pack import things
from anysim_household.spec import PackSpec
from anysim_household.things import OBJECTS
from anysim_schemas.load import load

STORE = ROOT / "docs" / "household.json"
PICTURES = ROOT / "docs" / "images"
FILES = {"kitchen": 0.46, "food": 0.25, "tools": 0.58, "home": 0.5}
"""And how far apart their things are drawn [m]."""
SPACING, COLUMNS = 0.55, 10
SECONDS, DROP = 3.0, 0.002
MOVED, TILTED = 0.005, 0.02
"""[m] and [rad] that a thing may be from where it was set down; what is round may have turned."""


def names_of(file: str) -> list[str]:
    """The things of a file, in its order."""
    return list(load(PackSpec, OBJECTS / f"{file}.yaml").spec.things)


def digest() -> str:
    """Of what the files say."""
    return hashlib.sha256(b"".join((OBJECTS / f"{file}.yaml").read_bytes() for file in FILES)).hexdigest()[:16]


def world(names: Sequence[str], columns: int, spacing: float) -> dict[str, Any]:
    """Things on a floor, row by row from the back to the front."""
    made: dict[str, Any] = {"terrain": {"kind": "plane", "color": [0.45, 0.46, 0.48]}, "objects": {}, "layout": {}}
    for number, name in enumerate(names):
        row, column = divmod(number, columns)
        made["objects"][name] = {"source": f"procedural:{name}"}
        made["layout"][name] = {"position": [-row * spacing, -column * spacing, DROP]}
    return made


def settled(engine: str) -> dict[str, list[float]]:
    """Of each thing: how far it is from where it was set down [m], how high [m], and its turn [rad]."""
    names = sorted(things(OBJECTS))
    with begun(engine, world(names, COLUMNS, SPACING), dt=0.002) as env:
        before = env.engine.get_state().body_pose[0].copy()
        for _ in range(round(SECONDS / 0.02)):
            env.step([[]])
        after = env.engine.get_state().body_pose[0]
        found = dict[str, list[float]]()
        for entity in env.engine.world.entities:
            if entity.name in names:
                a, b = before[entity.root], after[entity.root]
                turn = float(P.angle_between(a[3:], b[3:]))
                moved = (float(np.linalg.norm(b[:2] - a[:2])), float(b[2]), turn)
                found[entity.name] = [round(value, 5) for value in moved]
        return found


def draw(file: str) -> None:
    """The things of a file on each engine, side by side."""
    names = names_of(file)
    columns, spacing = (7 if len(names) > 20 else 5), FILES[file]
    depth, width = (len(names) - 1) // columns * spacing, (columns - 1) * spacing
    made = world(names, columns, spacing)
    middle = [0.1 - depth / 2, -width / 2, 0.0]
    eye = [0.45 + 0.72 * width, -width / 2, 0.35 + 0.8 * width]
    made["cameras"] = {"above": {"from": eye, "look_at": middle, "fov": 40.0, "size": [520, 400]}}
    picture = side_by_side(made, "above", 20, dt=0.002)
    picture.save(PICTURES / f"household_{file}.jpg", quality=82, optimize=True)


def told() -> dict[str, Any]:
    """What was measured."""
    return json.loads(STORE.read_text("utf-8"))


def is_round(name: str) -> bool:
    """Whether it may roll: it lies on a ball, or on a cylinder or capsule on its side."""
    spec = things(OBJECTS)[name][0]
    lying = [p for p in spec.pieces.values() if p.sphere or ((p.cylinder or p.capsule) and p.axis[2] == 0.0)]
    return any(abs(p.at[2] - (p.sphere or (p.cylinder or p.capsule or (0.0,))[0])) < 1e-9 for p in lying)


def page() -> str:
    """A table of the things of each file."""
    measured, parts = told()["engines"], list[str]()
    columns = ("thing", "mass", "size", "pieces", "joints", "affordances", *ENGINES)
    for file in FILES:
        rows = list[list[str]]()
        for name in names_of(file):
            model, spec = build(name, {}), things(OBJECTS)[name][0]
            low, high = extent(model)
            size = " x ".join(f"{100 * side:.3g}" for side in high - low)
            joints = ", ".join(f"{key} ({link.joint})" for key, link in spec.links.items())
            rests = [rested(name, measured[engine][name]) for engine in ENGINES]
            mass = f"{spec.mass:g} kg" if spec.mass >= 0.1 else f"{1000 * spec.mass:g} g"
            rows.append(
                [f"`{name}`", mass, f"{size} cm", str(len(model.geoms)), joints, ", ".join(spec.affords), *rests]
            )
        picture = f"![the things of {file}.yaml on MuJoCo, PyBullet and SAPIEN](images/household_{file}.jpg)"
        parts.append(f"### {file}\n\n{picture}\n\n{table(columns, rows)}")
    return "\n\n".join(parts)


def extent(model: ImportedModel) -> tuple[Array, Array]:
    """The corners of the box around a model as it stands, its joints at zero: links are parallel to the root then."""
    origins = [np.zeros(3)]
    for body in model.bodies[1:]:
        origins.append(origins[body.parent] + np.array(body.position))
    corners = [
        shape_bounds(geom.shape, np.array([*(origins[geom.body] + np.array(geom.position)), *geom.quaternion]), {})
        for geom in model.geoms
    ]
    return np.min([low for low, _ in corners], axis=0), np.max([high for _, high in corners], axis=0)


def rested(name: str, found: Sequence[float]) -> str:
    """What became of a thing in 3 s."""
    away, _, turn = found
    return f"{1000 * away:.1f} mm" if is_round(name) or turn < 0.001 else f"{1000 * away:.1f} mm, {turn:.3f} rad"


def restless() -> list[str]:
    """What did not stay as it was set down."""
    return [
        f"{name} on {engine} after {SECONDS:g} s: {away:.4f} m away, {height:.4f} m high, turned by {turn:.3f} rad"
        for engine, found in told()["engines"].items()
        for name, (away, height, turn) in found.items()
        if away > MOVED or abs(height) > DROP or (turn > TILTED and not is_round(name))
    ]


if __name__ == "__main__":
    if sys.argv[1:] == ["--measure"]:
        found = {engine: settled(engine) for engine in ENGINES}
        text = json.dumps({"digest": digest(), "engines": found}, indent=1, sort_keys=True)
        write_whole(STORE.parent, {STORE.name: text + "\n"})
        sys.argv[1:] = []
    if sys.argv[1:] == ["--draw"]:
        for file in FILES:
            draw(file)
        sys.argv[1:] = []
    code = main(__doc__, "things", "household_table.py", ["docs/household.md"], page)
    faults = restless()
    if told()["digest"] != digest():
        faults.append("docs/household.json is of other things; run python scripts/household_table.py --measure")
    sys.stderr.writelines(f"{fault}\n" for fault in faults)
    sys.exit(code or bool(faults))
