"""Walks of a policy of `go1_velocity` on every engine: five commands, shoves, a slippery floor and rough ground.

    python benchmarks/walking.py [NAME=POLICY ...] [--engines mujoco,sapien] [-n 32] [--rows shoves,floors] [--out FILE]
    python benchmarks/walking.py [NAME=POLICY ...] --engines mujoco --rows drawn --stiff

POLICY is what `anysim evaluate --policy` takes, and NAME what the table calls it; the trot and the shipped policy where
none is given. The robot is that of level L0; with `drawn` and on slippery floors that of L1, which is another one in
each episode. Without either all episodes would be the same walk, so `commands` are one each. Errors are the root mean
squares of the velocity along the ground and of the turn after the first 1.5 s, within a stride included; falls are of
8 s. With `--out FILE.json` each cell is on the disk once it is measured, and those that are there are not measured
again. `--stiff` makes MuJoCo's contacts as stiff as its time step lets them be, which tells whether a gap to the other
engines is one of contact.
"""

import argparse
import json
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

import anysim
from anysim.engine.state import State
from anysim.math import pose as P
from anysim.model.world import Surface
from anysim_evaluation.policy import make_policy
from anysim_mujoco.mjcf.surfaces import STIFF_IMPEDANCE, ContactParameters, contact_parameters

COMMANDS = ((0.5, 0.0, 0.0), (0.9, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.8), (0.5, 0.2, 0.5))
"""Forward and to the left [m/s], turning [rad/s]."""
SECONDS, SETTLED = 8.0, 1.5


class Walk(NamedTuple):
    """What came of some envs.

    Attributes:
        fell: how many fell.
        velocity: (3,) the mean, forward and left [m/s] and turning [rad/s].
        error, turn_error: of velocity [m/s] and turn [rad/s], over all steps of all envs.
        spread: the standard deviation of the error of an env over the envs [m/s].
        version: that of the policy.
    """

    fell: int
    velocity: np.ndarray
    error: float
    turn_error: float
    spread: float
    version: str


def shoved(speed: float) -> list[str]:
    """A shove of this speed in one of eight directions every two seconds."""
    directions = [[round(speed * float(v), 6) for v in (np.cos(a), np.sin(a), 0.0)] for a in np.arange(8) * np.pi / 4]
    return [f"task.events.shove.velocity={{choice: {directions}}}", "task.events.shove.every=2.0"]


def rough(height: float) -> list[str]:
    """Ground whose heights vary by this much both ways, in cells of 20 cm; robots set off to all sides of a flat."""
    ground = (
        f"kind: rough, amplitude: {height}, grain: 0.2, cell: 0.1, size: [16.0, 16.0], platform: 1.0, friction: 0.8"
    )
    place = ["position={range: [[-0.3, -0.3, 0.0], [0.3, 0.3, 0.0]]}", "yaw={range: [-3.14159, 3.14159]}"]
    return [f"world.terrain={{{ground}}}", *(f"world.robots.dog.{key}" for key in place)]


NOMINAL = ["level=L0"]
DRAWN = ["level=L1", "task.events.shove.velocity=[0.0, 0.0, 0.0]"]
CHANGES = {
    "commands": {"": NOMINAL},
    "drawn": {"": DRAWN},
    "shoves": {f"shoves of {speed:g} m/s": [*NOMINAL, *shoved(speed)] for speed in (0.5, 1.0)},
    "floors": {
        "friction 0.3": [*DRAWN, "world.robots.dog.dynamics.link_friction_scale=0.375"],
        **{f"rough, ±{100 * height:g} cm": [*NOMINAL, *rough(height)] for height in (0.02, 0.04, 0.06)},
    },
}
"""Overrides of the task by the name of their row, in groups."""


def walk(policy: str, engine: str, command: tuple[float, ...], num_envs: int, changes: list[str]) -> Walk:
    """Walk in all envs at once, in episodes of the test split; an env that has fallen is left alone."""
    asked = [f"task.command.walk.{key}={v}" for key, v in zip(("forward", "left", "turn"), command, strict=True)]
    asked += ["task.command.walk.still=0.0", "task.command.walk.straight=0.0"]
    overrides = ["record.cameras=[]", "world.cameras.front.channels=[]", *asked, *changes]
    with anysim.make("go1_velocity", engine=engine, num_envs=num_envs, overrides=overrides) as env:
        everyone = np.arange(num_envs)
        env.reset(episode_seeds=everyone + 20_000)
        made = make_policy(env, policy)
        made.reset(everyone)
        base, seen = env.engine.index.entity("dog").root, []
        steps = round(SECONDS / env.engine.world.physics.control_dt)
        first = round(SETTLED / env.engine.world.physics.control_dt)
        for step in range(steps):
            up = np.flatnonzero(env.running)
            if not len(up):
                break
            action = np.zeros((num_envs, env.action_dim))
            action[up] = made.act({group: rows[up] for group, rows in env.obs.items()}, up)
            env.step(action, None if len(up) == num_envs else env.running)
            if step >= first:
                rows = _own(env.engine.get_state(), base)
                seen.append(np.where(env.running[:, None], rows, np.nan))
        fell = int((env.status == "failed").sum())
    version = getattr(made, "version", "")
    walked = np.stack(seen) if seen else np.full((1, 1, 3), np.nan)
    walked = walked[:, np.isfinite(walked).any(axis=(0, 2))]
    if not walked.shape[1]:
        return Walk(fell, np.full(3, np.nan), np.nan, np.nan, np.nan, version)
    squares = (walked - np.array(command)) ** 2
    own = np.sqrt(np.nanmean(squares[..., :2].sum(axis=2), axis=0))
    error, turn = np.sqrt(np.nanmean(squares[..., :2].sum(axis=2))), np.sqrt(np.nanmean(squares[..., 2]))
    return Walk(fell, np.nanmean(walked, axis=(0, 1)), float(error), float(turn), float(own.std()), version)


def _own(state: State, base: int) -> np.ndarray:
    """(N, 3) velocity of the base along its own x and y, and its rate about its own z."""
    turn, twist = state.body_pose[:, base, 3:], state.body_twist[:, base]
    return np.concatenate([P.rotate_inverse(turn, twist[:, :3])[:, :2], P.rotate_inverse(turn, twist[:, 3:])[:, 2:]], 1)


def stiff(surface: Surface, dt: float) -> ContactParameters:
    """What MuJoCo is told of a surface, with a time constant of two steps and next to no compliance."""
    return replace(contact_parameters(surface, dt), solref=(2.0 * dt, 1.0), solimp=STIFF_IMPEDANCE)


def cells(policies: dict[str, str], engines: list[str], num_envs: int, groups: list[str]) -> Iterator[dict[str, Any]]:
    """What is asked of each policy on each engine; cells with changes walk at 0.5 m/s."""
    for name in policies:
        for group in groups:
            for what, _ in CHANGES[group].items():
                for command in COMMANDS if not what else COMMANDS[:1]:
                    for engine in engines:
                        yield {
                            "policy": name,
                            "group": group,
                            "what": what,
                            "command": list(command),
                            "engine": engine,
                            "envs": 1 if group == "commands" else num_envs,
                        }


def measured(policy: str, asked: dict[str, Any]) -> dict[str, Any]:
    """A cell with its numbers; `cpu_s` is what it took, the building of the envs included."""
    begun = process_time()
    changes = CHANGES[asked["group"]][asked["what"]]
    told = walk(policy, asked["engine"], tuple(asked["command"]), asked["envs"], changes)
    numbers = told._asdict() | {"velocity": told.velocity.tolist()}
    return (
        asked | {key: _rounded(value) for key, value in numbers.items()} | {"cpu_s": round(process_time() - begun, 1)}
    )


def _rounded(value: Any) -> Any:
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return value if not isinstance(value, float) else None if np.isnan(value) else round(value, 4)


def main() -> None:
    """Measure what is not measured yet, and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policies", nargs="*", default=["trot=expert", "shipped=shipped"], metavar="NAME=POLICY")
    parser.add_argument("--engines", default="mujoco,pybullet,sapien")
    parser.add_argument("-n", type=int, default=8, help="envs of each cell")
    parser.add_argument("--rows", default="commands,drawn,shoves,floors")
    parser.add_argument("--out", type=Path, help="a file of the results, which is added to")
    parser.add_argument("--stiff", action="store_true", help="MuJoCo's contacts as stiff as they can be")
    arguments = parser.parse_args()
    policies = {name: policy or name for name, _, policy in (text.partition("=") for text in arguments.policies)}
    done: list[dict[str, Any]] = json.loads(arguments.out.read_text("utf-8")) if _there(arguments.out) else []
    for asked in cells(policies, arguments.engines.split(","), arguments.n, arguments.rows.split(",")):
        if arguments.stiff:
            asked["stiff"] = True
        if any(asked.items() <= cell.items() and cell.get("stiff") == asked.get("stiff") for cell in done):
            continue
        surfaces = patch("anysim_mujoco.geoms.contact_parameters", stiff) if arguments.stiff else nullcontext()
        with surfaces:
            done.append(measured(policies[asked["policy"]], asked))
        print(json.dumps(done[-1]), flush=True)
        if arguments.out is not None:
            draft = arguments.out.with_suffix(".draft")
            draft.write_text("[\n" + ",\n".join(json.dumps(cell) for cell in done) + "\n]\n", "utf-8")
            draft.replace(arguments.out)


def _there(path: Path | None) -> bool:
    return path is not None and path.exists()


if __name__ == "__main__":
    main()
