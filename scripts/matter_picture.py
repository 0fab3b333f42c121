"""Pictures of fluid, sand and rice: docs/images/matter.jpg on three engines, and matter_physics.png against formulas.

`python scripts/matter_picture.py` writes them and prints the figures of docs/matter.md.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from pictures import begun, side_by_side

from anysim.conventions import Array
from anysim_particles.bench import tank

IMAGES = Path(__file__).parents[1] / "docs" / "images"
STEPS = 25
GRAVITY, WATER = 9.81, 1000.0


def world() -> dict[str, Any]:
    """A tank with a box that floats, a heap of sand and one of rice."""
    made = tank(0.12, 0.08, 0.01)
    made["objects"]["box"] = {"source": {"box": [0.04, 0.04, 0.04]}, "density": 400, "color": "red"}
    made["layout"]["box"] = {"position": [0.02, 0.0, 0.1]}
    made["cameras"] = {"eye": {"look_at": [0.05, -0.02, 0.02], "from": [0.16, -0.28, 0.24], "size": [400, 320]}}
    made["families"] = {
        "water": {"kind": "fluid", "box": [0.12, 0.12, 0.05]},
        "sand": {"kind": "sand", "cylinder": [0.025, 0.08], "position": [0.14, 0.02, 0.0]},
        "rice": {"kind": "rice", "box": [0.04, 0.04, 0.02], "position": [0.06, -0.11, 0.0]},
    }
    return made


@contextmanager
def alone(matter: dict[str, Any], world: dict[str, Any] | None = None) -> Iterator[tuple[Any, Any]]:
    """An env of MuJoCo with the family `it`, and that."""
    with begun("mujoco", {**(world or {}), "families": {"it": matter}}) as env:
        assert env.families is not None
        yield env, env.families.family("it")


def waited(env: Any, steps: int) -> None:
    """Go on for so many control steps."""
    for _ in range(steps):
        env.step([[]])


def dam(depth: float = 0.1, width: float = 0.06) -> Array:
    """(K, 2) times, in sqrt(depth / g), and how far the front of a column of so much water came, in depths."""
    made = tank(width, 0.2)
    for name, side in (("west", -1), ("east", 1)):
        made["layout"][name]["position"] = [0.46 * side, 0.0, 0.1]
    for name in ("south", "north"):
        made["objects"][name]["source"]["box"][0] = 0.9
    matter = {"kind": "fluid", "box": [depth, width, depth], "position": [-0.4, 0.0, 0.0], "smoothing": 0.02}
    rows = []
    with alone(matter, made) as (env, it):
        start = it.x[0, :, 0].max()
        for step in range(1, 18):
            waited(env, 1)
            rows.append([step * 0.02 / np.sqrt(depth / GRAVITY), (np.sort(it.x[0, :, 0])[-12] - start) / depth])
    return np.array(rows)


def pressures(edge: float = 0.08) -> Array:
    """(K, 2) depths [m] of water in a tank, and the mean pressure [Pa] on its floor."""
    rows = []
    for depth in (0.03, 0.06, 0.09, 0.12):
        with alone({"kind": "fluid", "box": [edge, edge, depth]}, tank(edge, 2 * depth)) as (env, it):
            waited(env, 40)
            before = it.received[0, 2]
            waited(env, 20)
            mass = float(it.particle_mass(np.array([0]))[0]) * len(it.x[0])
            rows.append([depth, ((it.received[0, 2] - before) / 0.4 + mass * GRAVITY) / edge**2])
    return np.array(rows)


def drafts(edge: float = 0.08, spacing: float = 0.0125) -> Array:
    """(K, 2) densities [kg/m^3] of a cube, and how much of it [m] is under water."""
    rows = []
    for density in (200.0, 400.0, 600.0, 800.0):
        made = tank(0.15, 0.3)
        made["objects"]["cube"] = {"source": {"box": [edge] * 3}, "density": density}
        made["layout"]["cube"] = {"position": [0.0, 0.0, 0.2]}
        with alone({"kind": "fluid", "box": [0.15, 0.15, 0.125], "spacing": spacing}, made) as (env, it):
            waited(env, 50)
            heights = []
            for _ in range(15):
                waited(env, 1)
                heights.append(env.engine.get_state().body_pose[0, it.met[0], 2])
            x = it.x[0]
            level = np.sort(x[np.abs(x[:, :2]).min(axis=1) > 0.05, 2])[-8:].mean() + spacing / 2
            rows.append([density, level - (np.mean(heights) - edge / 2)])
    return np.array(rows)


def slopes() -> Array:
    """(K, 2) coefficients of friction, and the angle [degrees] of the side of a column of sand that collapsed."""
    rows = []
    for friction in (0.1, 0.2, 0.3, 0.45, 0.6, 0.8):
        with alone({"kind": "sand", "cylinder": [0.05, 0.15], "radius": 0.005, "friction": friction}) as (env, it):
            waited(env, 60)
            x = it.x[0]
        away = np.hypot(*(x[:, :2] - np.median(x[:, :2], axis=0)).T)
        rings = np.arange(0.0, 0.3, 0.01)
        tops = np.array([x[(away >= a) & (away < a + 0.01), 2].max(initial=0.0) for a in rings])
        heap = slice(0, int(np.argmax(tops < 0.012)) + 1)  # to where one grain lies on the ground
        rows.append([friction, np.degrees(np.arctan(-np.polyfit(rings[heap], tops[heap], 1)[0]))])
    return np.array(rows)


def plot(path: Path) -> None:
    """Dots as found, on lines of formulas; and print how far they are off."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    found = {"dam": dam(), "pressure": pressures(), "draft": drafts(), "slope": slopes()}
    lines = {
        "dam": ("Front of a dam that breaks", "time / √(depth / g)", "way / depth", "Ritter: 2 √(g depth)"),
        "pressure": ("Pressure on the floor [Pa]", "depth of the water [m]", "", "density · g · depth"),
        "draft": ("A cube of 80 mm that floats", "its density [kg/m³]", "under water [m]", "Archimedes"),
        "slope": ("Side of a heap [degrees]", "coefficient of friction", "", "arctangent of it"),
    }
    told = {
        "dam": lambda t: 2 * t,
        "pressure": lambda depth: WATER * GRAVITY * depth,
        "draft": lambda density: 0.08 * density / WATER,
        "slope": lambda friction: np.degrees(np.arctan(friction)),
    }
    figure, axes = plt.subplots(1, 4, figsize=(15, 3.4), constrained_layout=True)
    for axis, (name, rows) in zip(axes, found.items(), strict=True):
        title, across, up, law = lines[name]
        line = np.linspace(0.0, rows[:, 0].max(), 50)
        axis.plot(line, told[name](line), color="#3c5aa0", label=law)
        axis.plot(rows[:, 0], rows[:, 1], "o", color="#c84628", markersize=4, label="found")
        axis.set(title=title, xlabel=across, ylabel=up)
        axis.legend(frameon=False)
        print(name, *(f"{x:.3g}: {y:.3g} ({told[name](x):.3g})" for x, y in rows), sep="\n  ")
    run = found["dam"][(found["dam"][:, 1] > 0.5) & (found["dam"][:, 1] < 2.0)]
    print(f"the front runs at {np.polyfit(run[:, 0], run[:, 1], 1)[0]:.2f} sqrt(g depth)")
    figure.savefig(path, dpi=80)


if __name__ == "__main__":
    side_by_side(world(), "eye", STEPS).save(IMAGES / "matter.jpg", quality=85)
    plot(IMAGES / "matter_physics.png")
