"""The walks of policies in docs/locomotion.md, from docs/walking.json, walking_matrix.json and walking_trainings.json.

    python scripts/walking_table.py [--check]

The first two files are made by these commands, which go on where they were cut off; the last has what trainings took:

    python benchmarks/walking.py trot=expert shipped -n 32 --out docs/walking.json
    python benchmarks/walking.py "seed 1=runs/…-1/policy.onnx" --rows commands -n 32 --out docs/walking.json
    python benchmarks/rough_walking.py shipped -n 8 --out docs/rough_walking.json
    python benchmarks/walking.py mujoco=runs/…/policy.onnx … --rows drawn -n 32 --out docs/walking_matrix.json

`--check` writes nothing and exits with 1 if the page has drifted from these files.
"""

import json
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from benchmark_table import table
from generated import ROOT, main

from anysim.math.statistics import wilson

STORE, TRAININGS = ROOT / "docs" / "walking.json", ROOT / "docs" / "walking_trainings.json"
MATRIX = ROOT / "docs" / "walking_matrix.json"
"""Walks of a policy of each engine, which is its name, on all of them."""
CROSSINGS = ROOT / "docs" / "rough_walking.json"
GOAL = 0.06
"""[m/s] of the error that a policy should have at most."""
POLICIES, GROUPS = ("trot", "shipped"), ("drawn", "shoves", "floors")
"""What is compared, in the order of the table."""
MISSING = "…"

Cell = Mapping[str, Any]


def cells() -> list[Cell]:
    """What was measured."""
    return json.loads(STORE.read_text("utf-8"))


def asked(cell: Cell) -> str:
    """A command in words."""
    units = zip(("forward", "left", "turning"), cell["command"], ("m/s", "m/s", "rad/s"), strict=True)
    return ", ".join(f"{name} {value:g} {unit}" for name, value, unit in units if value)


def fallen(cell: Cell) -> str:
    """How many fell, with the interval."""
    low, high = wilson(cell["fell"], cell["envs"])
    return f"{cell['fell']} ({100 * low:.0f} to {100 * high:.0f} %)"


def tracked(cell: Cell) -> str:
    """The speed that was reached along what was asked most for, and the errors of velocity and turn."""
    part = int(np.argmax(np.abs(cell["command"])))
    return f"{cell['velocity'][part]:.2f}; {cell['error']:.3f}, {cell['turn_error']:.3f}"


def walks() -> str:
    """The shipped policy beside the trot."""
    found = [cell for cell in cells() if cell["policy"] in POLICIES and cell["group"] != "commands"]
    engines = sorted({cell["engine"] for cell in found})
    rows: dict[tuple[str, str, str], dict[str, Cell]] = {}
    for cell in found:
        what = cell["what"] or asked(cell)
        rows.setdefault((cell["policy"], cell["group"], what), {})[cell["engine"]] = cell
    lines = [
        [what, policy, *_both(rows[policy, group, what], engines)]
        for group, what in sorted(dict.fromkeys(row[1:] for row in rows), key=lambda row: GROUPS.index(row[0]))
        for policy in POLICIES
        if (policy, group, what) in rows
    ]
    count = {cell["envs"] for cell in found}
    missing = any(MISSING in line for line in lines)
    return "\n\n".join(
        [
            f"Of each cell {', '.join(map(str, count))} episodes of 8 s of the test split: first how many fell, with "
            "Wilson's interval at 95 %, then the mean speed along what was asked most for, and the root mean "
            "squares of the errors of velocity [m/s] and turn [rad/s] while they were up"
            + (f"; {MISSING} is yet to be measured:" if missing else ":"),
            table(["what", "policy", *engines], lines),
        ]
    )


def _both(row: Mapping[str, Cell], engines: Sequence[str]) -> list[str]:
    return [f"{fallen(row[e])}; {tracked(row[e])}" if e in row else MISSING for e in engines]


def seeds() -> str:
    """Policies of several seeds of the training against the goals."""
    trained = json.loads(TRAININGS.read_text("utf-8"))
    found = cells()
    engines = sorted({cell["engine"] for cell in found})
    lines: list[list[str]] = []
    for one in trained:
        own = [cell for cell in found if cell["policy"] == one["policy"] and cell["group"] == "commands"]
        for command in dict.fromkeys(asked(cell) for cell in own):
            by_engine = {cell["engine"]: cell for cell in own if asked(cell) == command}
            lines.append([one["name"], command, *(_judged(by_engine[e]) if e in by_engine else "" for e in engines)])
    took = table(
        ["training", "steps", "best exam", "CPU s"],
        [
            [
                one["name"],
                f"{one['steps']:,}",
                f"{one['best']:.0%}",
                f"{one['cpu_s']:,}" if one["cpu_s"] else "not noted",
            ]
            for one in trained
        ],
    )
    return "\n\n".join(
        [
            "What the same command made of other seeds, and what it took on one busy core:",
            took,
            f"One walk of 8 s of each on the robot as it is in the catalogue: the error of velocity [m/s], of which at "
            f"most {GOAL} is good enough (others are bold), and falls where there were any:",
            table(["training", "command", *engines], lines),
        ]
    )


def crossings() -> str:
    """How many tiles of each kind and level a policy gets over, on each engine."""
    found: list[Cell] = [one for one in json.loads(CROSSINGS.read_text("utf-8")) if "robot" not in one]
    found.sort(key=lambda one: one["engine"])
    levels = range(len(found[0]["through"]))
    lines = []
    for k, kind in enumerate(found[0]["kinds"]):
        for one in found:
            own = [_told(one["through"][level][k], one["fell"][level][k]) for level in levels]
            lines.append([kind, one["engine"], str(one["n"]), *own])
    for one in found:
        total = one["n"] * len(one["kinds"])
        own = [_share(sum(one["through"][level]), total) for level in levels]
        lines.append(["all", one["engine"], str(total), *own])
    return "\n\n".join(
        [
            "How many of n tiles of each kind and level were left on foot, and how many ended in a fall where any did; "
            "of all kinds together the share, with Wilson's interval at 95 %:",
            table(["kind", "engine", "n", *(f"level {level}" for level in levels)], lines),
        ]
    )


def trots() -> str:
    """What share of the tiles of each level each robot's trot gets over, on each engine."""
    found: list[Cell] = [one for one in json.loads(CROSSINGS.read_text("utf-8")) if "robot" in one]
    found.sort(key=lambda one: (one["robot"], one["engine"]))
    lines = []
    for one in found:
        total = one["n"] * len(one["kinds"])
        shares = [_share(sum(row), total) for row in one["through"]]
        lines.append([f"`{one['robot']}`", one["engine"], str(total), *shares])
    return table(["trot of", "engine", "n", *(f"level {level}" for level in range(len(found[0]["through"])))], lines)


def _told(through: int, fell: int) -> str:
    return f"{through}" + (f" ({fell} fell)" if fell else "")


def _share(count: int, total: int) -> str:
    low, high = wilson(count, total)
    return f"{count / total:.0%} ({100 * low:.0f} to {100 * high:.0f})"


def engines() -> str:
    """Policies that were trained on each engine, on all of them, and which gaps are above the intervals."""
    found: list[Cell] = json.loads(MATRIX.read_text("utf-8"))
    names = sorted({cell["policy"] for cell in found})
    commands = list(dict.fromkeys(asked(cell) for cell in found))
    by = {(cell["policy"], asked(cell), _where(cell)): cell for cell in found}
    wheres = [*names, *sorted({_where(cell) for cell in found} - {*names})]
    lines, gaps = [], []
    for name in names:
        for command in commands:
            own = by[name, command, name]
            row = {where: by[name, command, where] for where in wheres}
            lines.append([name, command, *map(_measured, row.values())])
            gaps += [
                [name, command, where, f"{cell['error'] - own['error']:+.3f}", f"{cell['fell']}, {own['fell']}"]
                for where, cell in row.items()
                if _apart(cell, own)
            ]
    count = ", ".join(map(str, sorted({cell["envs"] for cell in found})))
    return "\n\n".join(
        [
            f"{count} episodes of 8 s of each cell with masses, gains and friction drawn: the error of velocity "
            "while they were up [m/s] and half its interval at 95 %, and how many fell, with Wilson's interval:",
            table(["trained on", "command", *(f"on {where}" for where in wheres)], lines),
            "Where an error or the falls are further from those on the engine of the training than intervals allow:",
            table(["trained on", "command", "on", "error more [m/s]", "falls there and where trained"], gaps),
        ]
    )


def _measured(cell: Cell) -> str:
    return f"{cell['error']:.3f} ± {_half(cell):.3f}" + (f", {fallen(cell)} fell" if cell["fell"] else "")


def _where(cell: Cell) -> str:
    return cell["engine"] + (", stiff" if cell.get("stiff") else "")


def _apart(cell: Cell, other: Cell) -> bool:
    """Whether the errors of two cells, or the shares that fell, are further apart than their intervals allow."""
    errors = abs(cell["error"] - other["error"]) > (_half(cell) ** 2 + _half(other) ** 2) ** 0.5
    (low, high), (least, most) = (wilson(one["fell"], one["envs"]) for one in (cell, other))
    return errors or low > most or least > high


def _half(cell: Cell) -> float:
    """Half the interval of the error at 95 %, of as many envs with an error each."""
    return 1.96 * cell["spread"] / cell["envs"] ** 0.5


def _judged(cell: Cell) -> str:
    error = f"{cell['error']:.3f}"
    falls = f", {cell['fell']} of {cell['envs']} fell" if cell["fell"] else ""
    return (error if cell["error"] <= GOAL else f"**{error}**") + falls


if __name__ == "__main__":
    pages = ("docs/locomotion.md",)
    tables = {"walks": walks, "seeds": seeds, "crossings": crossings, "trots": trots, "engines": engines}
    codes = [main(__doc__, name, "walking_table.py", pages, content) for name, content in tables.items()]
    sys.exit(max(codes))
