"""`anysim bench view`: what a view costs, measured with a client."""

import pytest

from anysim_viewer.bench import cost
from tests.task.helpers import BLOCKS


@pytest.mark.slow
def test_both_loops_are_measured_with_a_client_that_looks() -> None:
    fast, paced = cost(BLOCKS, None, 1, 30, 1)
    assert (fast.loop, paced.loop) == ("fast", "paced")
    for one in (fast, paced):
        assert one.alone > 0
        assert one.viewed > 0
        assert 0.0 < one.moments <= 1.0
