"""Which contacts a sensor counts, whatever number of bodies it has."""

import numpy as np
import pytest

from anysim.model.pairs import concerned, counted
from anysim.model.parts import ContactSensor


@pytest.mark.parametrize("bodies", [(2,), (0, 2), tuple(range(0, 40, 2))])
@pytest.mark.parametrize("against", [None, (-1,), (1, 3), tuple(range(1, 40, 2))])
def test_a_contact_counts_where_one_side_is_the_sensors_and_the_other_is_asked_for(
    bodies: tuple[int, ...], against: tuple[int, ...] | None
) -> None:
    first, second = np.random.default_rng(0).integers(-1, 6, (2, 60))
    on_first, on_second = counted(ContactSensor("it", bodies, against), first, second)
    for a, b, forward, backward in zip(first, second, on_first, on_second, strict=True):
        assert forward == (a in bodies and (against is None or b in against))
        assert backward == (b in bodies and (against is None or a in against))


def test_sensors_that_nothing_touches_are_left_out_and_no_others() -> None:
    sensors = [ContactSensor("a", (0,)), ContactSensor("b", (7, 8)), ContactSensor("c", (3, 9), (-1,))]
    first, second = np.array([0, 3, -1]), np.array([-1, 5, 8])
    found = list(concerned(sensors, first, second))
    assert [place for place, *_ in found] == [0, 1, 2]
    for place, *rows in found:
        assert all(map(np.array_equal, rows, counted(sensors[place], first, second)))
    assert [place for place, *_ in concerned(sensors, first[:2], second[:2])] == [0, 2]
    assert not list(concerned(sensors, first[:0], second[:0]))
