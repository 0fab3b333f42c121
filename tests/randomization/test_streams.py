"""Streams: what is drawn depends on the seed, the env and the name alone."""

import numpy as np

from anysim.randomization.distributions import draw_one
from anysim.randomization.draw import draw
from anysim.randomization.streams import Streams, stream_key
from anysim_schemas.values import Choice, LogUniform, Normal, NormalParameters, Range


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


def test_a_turned_generator_gives_what_a_new_one_gives() -> None:
    streams = episodes(3)
    for env, name, tick in ((0, "a", 0), (2, "layout/cube/x", 7), (1, "a", 2**40), (0, "a", 0)):
        new = streams.generator(env, name, tick)
        assert streams.shared_generator(env, name, tick).random((3, 2)).tolist() == new.random((3, 2)).tolist()
        new = streams.generator(env, name, tick)
        assert streams.shared_generator(env, name, tick).standard_normal() == new.standard_normal()


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
    uniform = np.array([draw_one(Range(range=((0.0, 2.0), (1.0, 4.0))), rng.random) for _ in range(4000)])
    assert (uniform >= [0, 2]).all()
    assert (uniform <= [1, 4]).all()
    assert np.allclose(uniform.mean(axis=0), [0.5, 3.0], atol=0.05)
    picks = [draw_one(Choice(choice=("a", "b"), weights=(3.0, 1.0)), rng.random) for _ in range(4000)]
    assert abs(picks.count("a") / 4000 - 0.75) < 0.03
    normal = np.array(
        [draw_one(Normal(normal=NormalParameters(mean=1.0, std=0.5, low=0.8)), rng.random) for _ in range(4000)]
    )
    assert normal.min() == 0.8
    assert abs(np.median(normal) - 1.0) < 0.03


def episodes(n: int) -> Streams:
    """Streams of n envs in their first episode."""
    streams = Streams(n)
    streams.seed(5, np.arange(n))
    streams.begin(np.arange(n))
    return streams


def test_log_uniform_values_spend_as_many_draws_in_each_decade() -> None:
    value = LogUniform(log_uniform=(0.01, 10.0))
    streams = episodes(3000)
    drawn = np.array([draw(value, "gain", streams, env) for env in range(3000)])
    assert drawn.min() >= 0.01
    assert drawn.max() <= 10.0
    shares = [np.mean((drawn >= low) & (drawn < 10 * low)) for low in (0.01, 0.1, 1.0)]
    assert np.allclose(shares, 1 / 3, atol=0.03)


def test_a_ratio_leaves_the_other_episodes_at_what_they_have_otherwise() -> None:
    streams = episodes(2000)
    gated = Range(range=(1.0, 2.0), ratio=0.3, otherwise=0.5)
    drawn = np.array([draw(gated, "mass", streams, env) for env in range(2000)])
    assert abs(np.mean(drawn == 0.5) - 0.7) < 0.03
    plain = Range(range=(1.0, 2.0))
    always = np.array([draw(plain, "mass", streams, env) for env in range(2000)])
    assert np.array_equal(drawn[drawn != 0.5], always[drawn != 0.5]), "the gate has a stream of its own"
    nominal = [draw(Range(range=(1.0, 2.0), ratio=0.0), "x", streams, env) for env in range(5)]
    assert nominal == [1.5] * 5


def test_fields_that_share_a_name_are_high_together_and_disturb_no_other() -> None:
    streams = episodes(200)
    mass = Range(range=(0.0, 2.0), shared="heavy")
    size = LogUniform(log_uniform=(0.1, 10.0), shared="heavy")
    noise = Normal(normal=NormalParameters(mean=0.0, std=1.0), shared="heavy")
    rows = np.array([[draw(v, n, streams, e) for n, v in (("m", mass), ("s", size), ("n", noise))] for e in range(200)])
    order = np.argsort(rows[:, 0])
    assert (np.diff(rows[order], axis=0) > 0).all()
    alone = Range(range=(0.0, 2.0))
    other = np.array([draw(alone, "alone", streams, env) for env in range(200)])
    assert abs(np.corrcoef(other, rows[:, 0])[0, 1]) < 0.2
    assert draw(mass, "m", streams, 0, tick=7) == rows[0, 0], "one draw for the episode"
