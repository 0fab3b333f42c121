"""Which contacts a sensor counts, whatever number of bodies it has."""

import numpy as np
import pytest

from anysim.model.pairs import counted
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
