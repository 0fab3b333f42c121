"""Do layouts hold? Cluttered tabletops, or rooms, on every engine: nothing begins inside of anything, all stays put.

    python benchmarks/layouts.py [--what tabletops|rooms] [--engine NAME] [--count N] [--seconds S] [--picture FILE]

Each tabletop has 10 to 15 objects: boxes, cylinders, capsules, balls and convex hulls of random sizes, in resting poses
drawn from their shapes, scattered over a table, some beside others. Each room is another one, with furniture of its
style, boxes and tins on its floor and books on what has a top. Printed for each engine: how deep contacts are at
the start (the engine's own, in the first step), how far things are from their places after one simulated second, and
what a layout costs. Exit code 1 if a contact is deeper than 1 mm or a thing more than 5 mm off its place.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from anysim.api import compile_world, load
from anysim.engine.factory import create_simulation, runnable
from anysim.managers.standard import standard_managers
from anysim.math import pose as P
from anysim_schemas.rooms import RoomSpec, furniture_names

DEPTH, DRIFT = 1e-3, 5e-3  # [m]
SLACK = 2e-5  # [m] of rounding: PyBullet has hulls 1 mm larger than they are, which is DEPTH exactly
PER_WORLD = 10  # layouts of one set of objects
TOPS = ("table", "desk", "nightstand")
"""Furniture that books lie on."""
KINDS = ("box", "box", "cylinder", "capsule", "sphere", "mesh")


def hull_file(folder: Path, rng: np.random.Generator, name: str) -> str:
    """A convex hull of random points as an OBJ file; anysim takes hulls of meshes."""
    from scipy.spatial import ConvexHull

    points = rng.normal(size=(12, 3))
    points *= rng.uniform(0.02, 0.04) / np.linalg.norm(points, axis=1)[:, None]
    points *= rng.uniform(0.6, 1.4, size=3)
    hull = ConvexHull(points)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    for simplex, plane in zip(hull.simplices, hull.equations, strict=True):
        a, b, c = points[simplex]
        turn = simplex if np.cross(b - a, c - a) @ plane[:3] > 0 else simplex[::-1]
        lines.append("f " + " ".join(str(i + 1) for i in turn))
    (folder / f"{name}.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(folder / f"{name}.obj")


def tabletop(seed: int, folder: Path) -> dict:
    """A world with a table and what stands on it."""
    rng = np.random.default_rng([7, seed])
    objects: dict = {"table": {"source": {"box": [0.45, 0.6, 0.4]}, "fixed": True}}
    layout: dict = {"table": {"position": [0.0, 0.0, 0.2]}}
    for k in range(int(rng.integers(10, 16))):
        kind, name = KINDS[int(rng.integers(len(KINDS)))], f"thing_{k:02d}"
        size = [round(float(v), 4) for v in rng.uniform(0.02, 0.1, size=3)]
        source: dict = {
            "box": {"box": size},
            "cylinder": {"cylinder": [round(0.4 * size[0], 4), size[1]]},
            "capsule": {"capsule": [round(0.3 * size[0], 4), size[1]]},
            "sphere": {"sphere": round(0.4 * size[0], 4)},
        }.get(kind) or {"mesh": hull_file(folder, rng, f"hull_{seed}_{k}")}
        objects[name] = {"source": source, "color": [round(float(v), 2) for v in rng.uniform(0.2, 0.95, size=3)]}
        place: dict = {"on": "table", "rest": "stable", "yaw": {"range": [-3.14, 3.14]}, "clearance": 0.002}
        if k in (4, 7):  # some of them in company
            place |= {"near": {"of": f"thing_{k - 1:02d}", "distance": [0.005, 0.08]}}
        layout[name] = place
    return {
        "world": {
            "name": f"tabletop_{seed}",
            "objects": objects,
            "layout": layout,
            "cameras": {"front": {"from": [0.62, 0, 0.95], "look_at": [0.03, 0, 0.4], "fov": 40, "size": [320, 240]}},
        }
    }


def room(seed: int, folder: Path) -> dict:
    """A world with a furnished room, and what lies about in it."""
    del folder
    rng = np.random.default_rng([8, seed])
    style = str(rng.choice(["living_room", "bedroom", "office", "kitchen"]))
    size = [round(float(v), 2) for v in rng.uniform((4.6, 4.2), (6.0, 5.4))]
    spec = {"style": style, "size": size, "seed": seed, "doors": [{"wall": "south", "at": 0.3}]}
    floor = {"rectangle": [[-size[0] / 2, -size[1] / 2], [size[0] / 2, size[1] / 2]]}
    objects: dict = {}
    layout: dict = {}
    for k in range(int(rng.integers(3, 7))):
        edges = [round(float(v), 3) for v in rng.uniform(0.1, 0.35, size=3)]
        source = {"box": edges} if k % 3 else {"cylinder": [round(edges[0] / 2, 3), edges[1]]}
        objects[f"thing_{k}"] = {
            "source": source,
            "color": [round(float(v), 2) for v in rng.uniform(0.2, 0.95, size=3)],
        }
        layout[f"thing_{k}"] = {"on": "terrain", "region": floor, "rest": "stable", "yaw": {"range": [-3.14, 3.14]}}
    tops = [name for name in furniture_names(RoomSpec.model_validate(spec)) if name.startswith(TOPS)]
    for k, piece in enumerate(tops):
        objects[f"book_{k}"] = {"source": {"box": [0.2, 0.14, 0.03]}}
        layout[f"book_{k}"] = {"on": piece, "yaw": {"range": [-3.14, 3.14]}}
    return {"world": {"name": f"room_{seed}", "room": spec, "objects": objects, "layout": layout}}


class Scene:
    """Envs of one world, without a task."""

    def __init__(self, source: dict, engine: str, num_envs: int) -> None:
        loaded = load({**source, "engine": engine, "num_envs": num_envs})
        self.world = compile_world(loaded)
        self.managers = standard_managers(loaded.spec, self.world, num_envs)
        self.engine = create_simulation(engine)
        self.engine.create_world(self.world, num_envs)
        self.streams = self.managers[0].streams
        self.envs = np.arange(num_envs)
        for manager in self.managers:
            manager.bind(self.engine)
        self.cost = 0.0

    def reset(self, seed: int) -> None:
        """New episodes; `cost` is the time of the processor that the layout took [s] for each env."""
        self.streams.seed(seed, self.envs)
        self.streams.begin(self.envs)
        self.engine.reset()
        for manager in self.managers:
            start = time.process_time()
            manager.reset(self.envs)
            if manager.name == "layout":
                self.cost = (time.process_time() - start) / len(self.envs)


def check(engine: str, what: str, count: int, seconds: float, folder: Path) -> bool:
    """Print what came of `count` layouts; True if all of them hold."""
    depths, drifts, costs, failed = [], [], [], []
    make, per_world = (tabletop, PER_WORLD) if what == "tabletops" else (room, 1)
    for number in range(-(-count // per_world)):
        envs = min(per_world, count - number * per_world)
        scene = Scene(make(number, folder), engine, envs)
        with scene.engine as simulation:
            scene.reset(number)
            costs.append(scene.cost)
            names = [body.name for body in scene.world.bodies]
            plan = simulation.get_state().body_pose.copy()
            simulation.step(1)  # some engines look for contacts only then; gravity moves things by less than 0.1 mm
            touching = simulation.contacts()
            depths += list(touching.depth)
            failed += [
                f"{what} {number} env {e}: {_name(names, a)} is {1e3 * d:.2f} mm inside of {_name(names, b)}"
                for e, a, b, d in zip(touching.env, touching.body_a, touching.body_b, touching.depth, strict=True)
                if d > DEPTH + SLACK
            ]
            simulation.step(round(seconds / scene.world.physics.dt))
            rest = simulation.get_state().body_pose
            drift = P.norm(rest[..., :3] - plan[..., :3])
            drifts += list(drift.ravel())
            failed += [
                f"{what} {number} env {e}: {names[b]} ({_shape(scene, b)}) is {1e3 * drift[e, b]:.1f} mm off"
                for e, b in np.argwhere(drift > DRIFT)
            ]
    print(
        f"{engine}: {count} {what}, {len(depths)} contacts in the first step, "
        f"deepest {1e3 * max(depths, default=0.0):.3f} mm; "
        f"after {seconds:g} s farthest {1e3 * max(drifts):.3f} mm off, "
        f"99 % within {1e3 * np.quantile(drifts, 0.99):.3f} mm; "
        f"{1e3 * np.mean(costs):.2f} ms of one core for each layout; {len(failed)} faults"
    )
    for line in failed[:20]:
        print(f"  {line}")
    return not failed


def draw(engine: str, file: Path, folder: Path, rows: int = 4) -> None:
    """A picture of rows x rows tabletops."""
    from PIL import Image

    tiles = []
    for number in range(rows):
        scene = Scene(tabletop(number, folder), engine, rows)
        with scene.engine as simulation:
            scene.reset(number)
            tiles.append(np.concatenate(list(simulation.render("front")["rgb"]), axis=1))
    whole = Image.fromarray(np.concatenate(tiles, axis=0))
    whole.quantize(128, dither=Image.Dither.NONE).save(file, optimize=True)


def _name(names: list[str], body: int) -> str:
    return "the ground" if body < 0 else names[body]


def _shape(scene: Scene, body: int) -> str:
    return " ".join(type(g.shape).__name__ for g in scene.world.geoms if g.body == body and g.collides)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--what", choices=("tabletops", "rooms"), default="tabletops")
    parser.add_argument("--engine", action="append", help="an engine; all that are installed where not given")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--picture", type=Path, help="draw sixteen of them instead, on the first engine")
    chosen = parser.parse_args()
    engines = chosen.engine or [name for name in runnable() if name != "null"]
    with tempfile.TemporaryDirectory() as folder:
        if chosen.picture is not None:
            draw(engines[0], chosen.picture, Path(folder))
            return 0
        held = [check(name, chosen.what, chosen.count, chosen.seconds, Path(folder)) for name in engines]
        return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())
