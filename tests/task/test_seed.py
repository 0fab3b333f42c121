"""The seed of a file: what is drawn follows from it unless another is given."""

import anysim
from tests.task.helpers import BLOCKS


def first_episode(seed: int | None, written: int = 0) -> dict[str, object]:
    with anysim.make({**BLOCKS, "seed": written}) as env:
        env.reset(seed=seed)
        return dict(env.streams.draws[0])


def test_the_seed_of_the_file_is_that_of_the_first_reset() -> None:
    assert first_episode(None, 3) == first_episode(3) != first_episode(None, 4)


def test_a_given_seed_wins() -> None:
    assert first_episode(3, 4) == first_episode(3)


def test_what_an_episode_draws_is_explained_for_the_file_s_seed() -> None:
    from anysim_inspect.draws import explain

    assert explain({**BLOCKS, "seed": 3}).episode_seed == explain(BLOCKS, seed=3).episode_seed
