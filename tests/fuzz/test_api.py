"""Calls of the API with hostile values: each does what was asked, or ends in a sentence and leaves the env usable."""

import warnings
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import anysim
from anysim.errors import AnysimError
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_engine
from tests.fuzz.budget import Tally
from tests.fuzz.documents import HOSTILE, Dice
from tests.task.helpers import BLOCKS

COUNT, SEED = 2_000, 12
ENDLESS: list[Any] = []
ENDLESS.append(ENDLESS)
ITSELF: dict[Any, Any] = {}
ITSELF["layout.red.x"] = ITSELF
ODD: tuple[Any, ...] = (
    *HOSTILE,
    ENDLESS,
    ITSELF,
    object(),
    b"bytes",
    bytearray(b"ab"),
    memoryview(b"abc"),
    1j,
    datetime(2020, 1, 1),
    range(3),
    {1, 2},
    np.float32(1),
    np.int64(-3),
    np.uint8(2),
    np.array(5),
    np.zeros((0, 0)),
    np.zeros((2, 2, 2)),
    np.array([True, False]),
    np.array([1, 0]),
    np.array(["a", "b"]),
    np.array([None, 1]),
    np.full(2, np.nan),
    np.full(2, 1e300),
    np.ma.masked_array([1.0, 2.0], mask=[True, False]),
    np.array(["2020-01-01"] * 2, dtype="datetime64[D]"),
    np.zeros(2, dtype=[("a", float)]),
    [[1], [1, 2]],
    [10**400, 1],
    lambda: None,
    Path("nowhere"),
    (x for x in ()),
)
KEYS: tuple[Any, ...] = (
    *range(3),
    None,
    "layout.red.x",
    "layout.red",
    "objects.red.mass",
    "world.layout.red.yaw",
    "a",
    "",
)


class Calls:
    """Draws calls on an env of two, which each leave it running or raise."""

    def __init__(self, seed: int, engine: str) -> None:
        self.dice, self.engine = Dice(seed), engine
        self.env = self.fresh()

    def fresh(self) -> TaskEnv:
        """An env that has been reset."""
        env = anysim.make(BLOCKS, engine=self.engine, num_envs=2, overrides=["task.ended=hold"])
        env.reset(seed=0)
        return env

    def odd(self) -> Any:
        """A hostile value, now and then several or under a key."""
        how = self.dice.random()
        if how < 0.7:
            return self.dice.choice(ODD)
        if how < 0.85:
            return [self.dice.choice(ODD) for _ in range(self.dice.randint(0, 3))]
        return {self.dice.choice(KEYS): self.dice.choice(ODD)}

    def shaped(self, rows: np.ndarray) -> Any:
        """An array of the right shape with something wrong in it, or a hostile value."""
        kinds: tuple[Callable[[], Any], ...] = (
            lambda: rows,
            lambda: rows * np.nan,
            lambda: rows + 1e308,
            lambda: rows + 1j,
            lambda: rows.astype("U8"),
            lambda: rows.astype(object),
            lambda: rows[:1],
            lambda: rows[..., :-1],
            lambda: rows.tolist(),
            lambda: rows.astype("timedelta64[s]"),
            self.odd,
            self.odd,
        )
        return self.dice.choice(kinds)()

    def call(self) -> tuple[str, Callable[[], object]]:
        """A call, and what it is."""
        env, odd, dice = self.env, self.odd, self.dice
        engine = env.engine
        bodies, joints = np.zeros((2, 3, 7)), np.zeros((2, len(engine.world.joints)))
        bodies[..., 6] = 1.0
        kinds: dict[str, Callable[[], object]] = {
            "make source": lambda: self.made(odd()),
            "make num_envs": lambda: self.made(BLOCKS, num_envs=odd()),
            "make engine": lambda: self.made(BLOCKS, engine=odd()),
            "make seed": lambda: self.made(BLOCKS, seed=odd()),
            "make overrides": lambda: self.made(BLOCKS, overrides=odd()),
            "make override": lambda: self.made(BLOCKS, overrides=[f"{dice.choice(PATHS)}={text(odd())}"]),
            "make base": lambda: self.made(BLOCKS, base=odd()),
            "make proposals": lambda: self.made(BLOCKS, proposals=odd()),
            "make record": lambda: self.made(BLOCKS | {"record": {dice.choice(RECORD): odd()}}),
            "reset seed": lambda: env.reset(seed=odd()),
            "reset mask": lambda: env.reset(mask=odd()),
            "reset episode_seeds": lambda: env.reset(episode_seeds=odd()),
            "reset overrides": lambda: env.reset(overrides=odd()),
            "reset override": lambda: env.reset(overrides={dice.choice(list(env.counterfactuals.paths)): odd()}),
            "step": lambda: env.step(self.shaped(np.zeros((2, env.action_dim)))),
            "step mask": lambda: env.step(np.zeros((2, env.action_dim)), odd()),
            "snapshot": lambda: env.snapshot(odd()),
            "reset_to": lambda: env.reset_to(odd()),
            "reset_to env_ids": lambda: env.reset_to(env.snapshot(), env_ids=odd()),
            "reset_to overrides": lambda: env.reset_to(env.snapshot(), overrides=odd()),
            "rows": lambda: env.snapshot().rows(odd()),
            "render camera": lambda: env.render(odd()),
            "render size": lambda: env.render(size=odd()),
            "render env_ids": lambda: env.render(env_ids=odd()),
            "set_body_state": lambda: engine.set_body_state(self.shaped(bodies)),
            "set_body_state bodies": lambda: engine.set_body_state(bodies[:, :1], bodies=odd()),
            "set_joint_state": lambda: engine.set_joint_state(self.shaped(joints)),
            "set_control": lambda: engine.set_control(position=self.shaped(np.zeros((2, 0)))),
            "apply_wrench": lambda: engine.apply_wrench(self.shaped(np.zeros((2, 3, 6))), [0, 1, 2]),
            "engine step": lambda: engine.step(odd()),
            "get_parameters": lambda: engine.get_parameters(odd()),
            "set_parameters": lambda: engine.set_parameters("body.mass", self.shaped(np.ones((2, 3)))),
            "set_parameters name": lambda: engine.set_parameters(odd(), np.ones((2, 3))),
            "set_parameters indices": lambda: engine.set_parameters("body.mass", np.ones((2, 1)), indices=odd()),
            "raycast": lambda: engine.raycast(odd(), odd()),
            "contacts": lambda: engine.contacts(odd()),
            "engine render": lambda: engine.render(width=odd(), height=odd()),
        }
        what = dice.choice(list(kinds))
        return f"{self.engine}: {what}", kinds[what]

    def made(self, source: Any, **asked: Any) -> None:
        """Make an env of a few, use it, and free it."""
        asked = {"engine": self.engine} | asked
        with anysim.make(source, **asked) as env:
            env.reset()

    def usable(self) -> None:
        """Whatever was asked of the env, it goes on."""
        try:
            self.env.reset(seed=1)
            self.env.step(np.zeros((2, self.env.action_dim)))
        except AnysimError as error:
            raise AssertionError(f"the env cannot go on: {error}") from error


PATHS = (
    "num_envs",
    "seed",
    "physics.dt",
    "world.layout.red.x",
    "task.horizon",
    "engine",
    "record.cameras",
    "a..b",
    "=",
)
RECORD = ("cameras", "writer", "keep", "film", "markers", "fps", "x")


def text(value: Any) -> str:
    """A value as an override has it."""
    try:
        return repr(value)[:200]
    except RecursionError:
        return "[["


def fuzz(count: int, seed: int, engine: str) -> Tally:
    """Try calls on an env of an engine."""
    calls, tally = Calls(seed, engine), Tally(f"API calls on {engine}")
    try:
        for number in range(count):
            what, call = calls.call()
            before = len(tally.faults)
            tally.run(f"{number}: {what}", call)
            try:
                calls.usable()
            except Exception as error:  # noqa: BLE001 - that is what is looked for
                tally.fault(f"after {number}: {what}", error)
            if len(tally.faults) > before:
                calls.env.close()
                calls.env = calls.fresh()
    finally:
        calls.env.close()
    return tally


@pytest.fixture(autouse=True)
def _without_warnings() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of numbers that overflow
        yield


@pytest.mark.full
@pytest.mark.parametrize(("engine", "count"), [("null", COUNT - 400), ("mujoco", 400)])
def test_hostile_calls_end_in_a_sentence(engine: str, count: int) -> None:
    require_engine(engine)
    fuzz(count, SEED, engine).passed(count)


def test_a_hundred_calls() -> None:
    tally = fuzz(100, SEED + 1, "null")
    tally.passed(100)
    assert min(tally.accepted, tally.refused) >= 5, tally.report
