"""The benchmark of steps: its budgets, and that its loops write commands that change."""

import json
from pathlib import Path

import numpy as np
import pytest

from anysim import api, registry
from anysim.engine.base import SimEngine
from anysim.engine.control import NUDGE
from anysim.engine.factory import create_simulation
from anysim_bench import step
from anysim_bench.cli import bench as cli


@pytest.mark.parametrize(
    ("engine", "what", "actuation", "num_envs", "least"),
    [
        ("mujoco", "engine", "implicit_pd", 1, 0.90),
        ("pybullet", "engine", "native", 1, 0.88),
        ("pybullet", "engine", "implicit_pd", 1, 0.65),
        ("sapien", "engine", "implicit_pd", 64, 0.92),
        ("pybullet", "env", "implicit_pd", 16, 0.88),
        ("pybullet", "env", "implicit_pd", 1, None),
        ("a strangers", "engine", "native", 4, 0.65),
        ("a strangers", "engine", "native", 128, 0.90),
        ("a strangers", "env", "native", 16, None),
    ],
)
def test_budgets(engine, what, actuation, num_envs, least):
    assert step.budget(engine, what, actuation, num_envs) == least


def test_the_page_of_the_benchmarks_has_these_budgets():
    page = (Path(__file__).parents[3] / "benchmarks" / "README.md").read_text()
    head, _, *rows = (
        [cell.strip().replace("`", "") for cell in line.strip("|").split("|")]
        for line in page.partition("## A step")[2].partition("\n## ")[0].splitlines()
        if line.startswith("|")
    )
    sizes = [int(name.split()[0]) for name in head[3:]]
    assert {row[0] for row in rows} == {"mujoco", "pybullet", "sapien"}
    for engine, what, drives, *cells in rows:
        for actuation in drives.split(", "):
            found = [step.budget(engine, what, actuation, size) for size in sizes]
            assert cells == ["" if least is None else f"{least:.2f}" for least in found]


def test_a_ratio_below_its_budget_is_missed():
    cost = step.StepCost("mujoco", "engine", "native", 1, 89.0, 100.0, 0.89, 0.95, 0.90)
    assert cost.missed
    assert not cost._replace(ratio=0.90).missed
    assert not cost._replace(budget=None).missed


def test_commands_change_from_control_step_to_control_step():
    with create_simulation("mujoco") as engine:
        engine.create_world(api.compile_world(step.panda_and_boxes()))
        one_step = step.control_loop(engine, 1)
        seen = []
        for _ in range(4):
            one_step()
            seen.append(engine.control.position)
    assert np.array_equal(seen[0], seen[2])
    assert np.array_equal(seen[1], seen[3])
    assert (seen[0] != seen[1]).all()


def test_in_a_task_the_targets_of_the_arm_alternate_too(monkeypatch):
    monkeypatch.setattr(step, "CHUNK_STEPS", 1)
    seen, write = [], SimEngine.set_control

    def spy(engine, *values, **keywords):
        write(engine, *values, **keywords)
        seen.append(engine.control.position[:, :7])

    monkeypatch.setattr(SimEngine, "set_control", spy)
    assert step.env_cost("mujoco", 1, rounds=1).ratio > 0
    last, before, earlier = seen[-1], seen[-2], seen[-3]
    assert np.allclose(last, earlier, rtol=0, atol=1e-12)
    assert np.allclose(np.abs(last - before), NUDGE)


def test_rows_appear_as_they_are_measured(monkeypatch):
    """Each row is out before the next is measured; with --json nothing but the document is."""
    costs = [step.StepCost("mujoco", "engine", mode, 1, 1.0, 1.0, 1.0, 1.0, None) for mode in ("native", "implicit_pd")]
    turns, seen = iter(costs), []
    out = []
    monkeypatch.setattr("typer.echo", lambda text, err=False: None if err else out.append(text))

    def measure(*_):
        seen.append(len(out))
        return next(turns)

    monkeypatch.setattr(step, "engine_cost", measure)
    cli.step(engine="mujoco", num_envs="1", task="")
    assert seen == [1, 2], "the head, and then a row before the second measurement"
    assert [line.split("\t")[2] for line in out] == ["drives", "native", "implicit_pd"]
    turns, out[:] = iter(costs), []
    cli.step(engine="mujoco", num_envs="1", task="", json=True)
    assert len(json.loads("".join(out))) == 2


def test_a_row_ends_after_its_time(monkeypatch):
    """Three rounds are measured whatever they take, and no more once the time is over."""
    monkeypatch.setattr(step, "CHUNK_STEPS", 1)
    calls = []

    def ours():
        calls[-1] += 1

    monkeypatch.setattr(step, "control_loop", lambda engine, substeps: ours)
    for seconds in (0.0, 1e9):
        calls.append(0)
        step.engine_cost("mujoco", 1, 6, seconds=seconds)
    assert 0 < calls[1] == 2 * calls[0]


def test_any_world_can_be_stepped(tmp_path, monkeypatch):
    """For an engine that holds no Panda: one ball that falls, without drives, and without a budget."""
    monkeypatch.setattr(step, "CHUNK_STEPS", 1)
    file = tmp_path / "ball.yaml"
    file.write_text(
        "world: {terrain: none, objects: {ball: {source: {sphere: 0.1}}}, layout: {ball: {position: [0, 0, 9]}}}\n"
    )
    cost = step.engine_cost("mujoco", 1, 1, world_file=str(file))
    assert cost.ours > 0
    assert cost.budget is None


def test_tasks_are_told_in_control_steps(monkeypatch, capsys):
    """Ten substeps of physics are one control step, on either side."""
    cost = step.StepCost("mujoco", "env", "implicit_pd", 4, 900.0, 1000.0, 0.9, 0.95, None)
    monkeypatch.setattr(step, "env_cost", lambda *_: cost)
    cli.tasks(task="reach, pick_cube", engine="mujoco", num_envs=4, json=True)
    found = json.loads(capsys.readouterr().out)
    assert [row["task"] for row in found] == ["reach", "pick_cube"]
    assert (found[0]["control_steps_per_second"], found[0]["raw"]) == (90.0, 100.0)


def test_the_tasks_that_are_measured_are_installed():
    assert set(cli.TASKS.split(",")) <= set(registry.names("tasks"))
