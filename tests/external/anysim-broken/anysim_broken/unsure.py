"""An engine that breaks the rule that `availability` never raises."""

from anysim.engine.state import Availability
from anysim.testing.kinematic import NullEngine


class UnsureEngine(NullEngine):
    """Imports well, and fails when it is asked whether it can run."""

    name = "unsure"

    @classmethod
    def availability(cls) -> Availability:
        """Looks at a driver that is not there."""
        raise OSError("the driver does not answer")
