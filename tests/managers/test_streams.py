"""Streams: what is drawn depends on the seed, the env and the name alone."""

import numpy as np

from anysim.managers.streams import Streams, stream_key
from anysim.managers.values import draw, draw_one
from anysim_schemas.values import Choice, Normal, NormalParameters, Range


def test_stream_keys_are_the_same_on_every_machine() -> None:
    assert stream_key("layout/cube/x") == 3997077788233319243
    assert stream_key("a") != stream_key("b")


def test_draws_depend_on_the_name_and_not_on_what_else_is_drawn() -> None:
    streams = Streams(1)
    streams.seed(5, np.array([0]))
    streams.begin(np.array([0]))
    alone = draw(Range(range=(0.0, 1.0)), "a", streams, 0)
    draw(Range(range=(0.0, 1.0)), "b", streams, 0)
    draw(Range(range=(0.0, 1.0)), "c", streams, 0)
    assert draw(Range(range=(0.0, 1.0)), "a", streams, 0) == alone
    assert draw(Range(range=(0.0, 1.0)), "b", streams, 0) != alone


def test_ticks_give_fresh_draws_without_state() -> None:
    streams = Streams(1)
    streams.seed(5, np.array([0]))
    streams.begin(np.array([0]))
    values = [streams.generator(0, "noise", tick).random() for tick in range(50)]
    assert len(set(values)) == 50
    assert values[7] == streams.generator(0, "noise", 7).random()


def test_envs_and_episodes_differ_and_repeat() -> None:
    def seeds(n: int) -> list[list[int]]:
        streams = Streams(n)
        streams.seed(1, np.arange(n))
        rows = []
        for _ in range(3):
            streams.begin(np.arange(n))
            rows.append([int(s) for s in streams.episode_seed])
        return rows

    four, two = seeds(4), seeds(2)
    assert [row[:2] for row in four] == two
    assert len({s for row in four for s in row}) == 12


def test_skip_equals_begin() -> None:
    a, b = Streams(1), Streams(1)
    for s in (a, b):
        s.seed(3, np.array([0]))
    a.skip(0, 2)
    b.begin(np.array([0]))
    b.begin(np.array([0]))
    a.begin(np.array([0]))
    b.begin(np.array([0]))
    assert a.episode_seed[0] == b.episode_seed[0]


def test_values_have_the_distribution_they_name() -> None:
    rng = np.random.default_rng(0)
    uniform = np.array([draw_one(Range(range=((0.0, 2.0), (1.0, 4.0))), rng) for _ in range(4000)])
    assert (uniform >= [0, 2]).all()
    assert (uniform <= [1, 4]).all()
    assert np.allclose(uniform.mean(axis=0), [0.5, 3.0], atol=0.05)
    picks = [draw_one(Choice(choice=("a", "b"), weights=(3.0, 1.0)), rng) for _ in range(4000)]
    assert abs(picks.count("a") / 4000 - 0.75) < 0.03
    normal = np.array([draw_one(Normal(normal=NormalParameters(mean=1.0, std=0.5, low=0.8)), rng) for _ in range(4000)])
    assert normal.min() == 0.8
    assert abs(np.median(normal) - 1.0) < 0.03
