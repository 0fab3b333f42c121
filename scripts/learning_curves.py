"""Draw docs/images/learning_curves.png from docs/learning_curves.json, which has rows of trainings' curve.jsonl.

    python scripts/learning_curves.py
    python scripts/learning_curves.py --add NAME DIRECTORY

`--add` keeps the curve of a training's directory under a name before it draws.
"""

import argparse
import json
from pathlib import Path
from typing import Any

from anysim.record.commit import write_whole

ROOT = Path(__file__).parents[1]
STORE, PICTURE = ROOT / "docs/learning_curves.json", ROOT / "docs/images/learning_curves.png"


def curve(folder: Path) -> dict[str, list[float]]:
    """Steps and exams of a training, each once: what an interrupted one had written twice counts as it was last."""
    rows: dict[int, float] = {}
    for line in (folder / "curve.jsonl").read_text("utf-8").splitlines():
        row: dict[str, Any] = json.loads(line)
        rows[int(row["steps"])] = round(float(row["exam"]), 4)
    return {"steps": list(map(float, rows)), "exam": list(rows.values())}


def draw(curves: dict[str, dict[str, list[float]]]) -> None:
    """One line for each training: the share of 64 validation episodes that it solved without noise."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axis = figure.subplots()
    for name, found in curves.items():
        axis.plot([steps / 1e6 for steps in found["steps"]], [100 * exam for exam in found["exam"]], label=name)
    axis.set_xlabel("control steps of all envs [million]")
    axis.set_ylabel("solved in the exam [%]")
    axis.set_ylim(0, 102)
    axis.grid(alpha=0.3)
    figure.legend(fontsize=8, loc="outside lower left")
    figure.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--add", nargs=2, metavar=("NAME", "DIRECTORY"), help="a training to keep")
    given = parser.parse_args().add
    known = json.loads(STORE.read_text("utf-8")) if STORE.exists() else {}
    if given:
        known[given[0]] = curve(Path(given[1]))
        write_whole(STORE.parent, {STORE.name: json.dumps(known, indent=1) + "\n"})
    draw(known)
