"""A view of a run that goes on: it changes nothing, and costs little while nobody looks."""

import threading
from typing import Any

import numpy as np
import pytest

import anysim
from anysim import hooks
from anysim_viewer.client import connected
from anysim_viewer.watch import RunView
from tests.plugins.viewer.person import Person
from tests.task.helpers import BLIND, BLOCKS


def steps(env: Any, count: int) -> list[Any]:
    still = np.zeros((env.num_envs, env.action_dim))
    found = []
    for _ in range(count):
        if not env.running.all():
            env.reset(mask=~env.running)
        found.append(env.step(still))
    return found


def test_what_is_watched_comes_out_as_what_is_not() -> None:
    with anysim.make(BLOCKS, num_envs=2) as env, RunView(env, port=0) as view:
        env.reset(seed=4)
        with connected(view.url) as client:
            person = Person(client)
            person.until(lambda: view.watched)
            watched = steps(env, 20)
            assert view.handed >= 1
            person.until(lambda: "as it runs" in person.words and "/goals/goal" in person.nodes)
    with anysim.make(BLOCKS, num_envs=2) as env:
        env.reset(seed=4)
        for a, b in zip(watched, steps(env, 20), strict=True):
            np.testing.assert_array_equal(a.obs["policy"], b.obs["policy"])
            np.testing.assert_array_equal(a.reward, b.reward)
    assert not any(isinstance(one, RunView) for one in hooks.manager().get_plugins())


def test_nothing_is_handed_over_while_nobody_looks() -> None:
    with anysim.make(BLOCKS) as env, RunView(env, port=0) as view:
        env.reset(seed=0)
        steps(env, 10)
        assert view.handed == 0


def test_a_run_waits_while_it_is_paused_and_goes_on_step_by_step() -> None:
    with anysim.make(BLOCKS) as env, RunView(env, port=0) as view:
        env.reset(seed=0)
        with connected(view.url) as client:
            person = Person(client)
            person.until(lambda: view.watched)
            done: list[int] = []
            thread = threading.Thread(target=lambda: [(steps(env, 1), done.append(1)) for _ in range(30)])
            person.press("Pause")
            person.until(lambda: not view._transport.playing)
            thread.start()
            person.until(lambda: env.scene.elapsed[0] == 1 and not done)
            person.press("Step")
            person.until(lambda: len(done) == 1)
            person.until(lambda: "step 2" in person.words)
            assert len(done) == 1
        thread.join(60)  # nobody looks any more
        assert len(done) == 30


def test_it_ends_with_its_env() -> None:
    with anysim.make(BLOCKS) as env:
        view = RunView(env, port=0).__enter__()
        env.reset(seed=0)
    assert not hooks.manager().is_registered(view)
    assert not view._thread.is_alive()
    view.close()


@pytest.mark.slow
def test_the_command_shows_a_run(command_line: Any, tmp_path: Any) -> None:
    from typer.testing import CliRunner

    options = [word for one in (*BLIND, "task.horizon=3") for word in ("-o", one)]
    words = ["run", "pick_cube", "-e", "null", *options, "--out", str(tmp_path / "run"), "--view"]
    ran = CliRunner().invoke(command_line, words)
    assert ran.exit_code == 0, ran.output
    assert "view of pick_cube: http://127.0.0.1:" in ran.output
