"""The commands of the page on banks, each with few candidates, and what skills do with the banks that they make."""

import json
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from anysim import make
from anysim.skills.runner import SkillPolicy
from anysim_banks.cli import app
from tests.plugins.skills.banks import task
from tests.plugins.skills.test_pick import rollout

PAGE = Path(__file__).parents[2] / "docs" / "banks.md"
SAID = [line[11:] for line in PAGE.read_text().splitlines() if line.startswith("    anysim bank build ")]
SLOW = ("--gripper xarm7_allegro", "--object block")
"""Of what is on the page, what takes more than a few seconds."""


def tiers(lines: list[str]) -> list[Any]:
    return [pytest.param(x, marks=pytest.mark.slow) if any(y in x for y in SLOW) else x for x in dict.fromkeys(lines)]


def built(folder: Path, words: list[str], raw: int, keep: int) -> list[dict[str, Any]]:
    """Run it on one engine with other counts."""
    for option in ("-e", "--raw", "--keep", "--out"):
        if option in words:
            at = words.index(option)
            words = words[:at] + words[at + 2 :]
    counts = ["--raw", str(raw), "--keep", str(keep), "--out", str(folder / "banks"), "--json"]
    result = CliRunner().invoke(app, [*words, *counts])
    assert result.exit_code == 0, result.exception
    return json.loads(result.stdout)["banks"]


@pytest.mark.parametrize("line", tiers(SAID))
def test_a_command_of_the_page_makes_banks(line: str, tmp_path: Path) -> None:
    rows = built(tmp_path, shlex.split(line)[1:], 120, 4)
    kept = [row for row in rows if "file" in row]
    assert kept, rows
    assert all(Path(row["file"]).exists() and 1 <= row["kept"] <= 4 for row in kept)


def test_the_page_has_commands_for_handles_insertions_and_hands() -> None:
    assert [any(word in line for line in SAID) for word in (".handle", "--object block", "xarm7_allegro")] == [True] * 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of", "words", "key", "raw"),
    [
        ("open_drawer", "--object cabinet -a drawer_1.handle", "bank", 400),
        ("peg_in_hole", "--object block", "insertions", 360),
        ("dex_grasp", "--object bottle --gripper xarm7_allegro", "bank", 200),
    ],
)
def test_a_skill_succeeds_with_a_bank_that_was_built(of: str, words: str, key: str, raw: int, tmp_path: Path) -> None:
    [row] = built(tmp_path, ["build", of, *words.split()], raw, 16)
    path = task(tmp_path, of, **{key: str(Path(row["file"]).relative_to(tmp_path))})
    with make(path, engine="mujoco", num_envs=4, overrides=["record.cameras=[]"]) as env:
        env.reset(seed=1)
        policy = SkillPolicy(env)
        said = rollout(env, policy, 900)
        assert policy.describe(0)[key]["version"] == row["version"]  # pyright: ignore[reportIndexIssue]
        assert np.sum(np.array(said) == "success") >= 2, said
