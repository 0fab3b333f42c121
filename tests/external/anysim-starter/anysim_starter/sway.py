"""A policy without a network: joints that sway about their home, as far as they are told."""

from typing import Annotated

import numpy as np
from pydantic import Field

from anysim.controllers.base import ChannelView
from anysim.conventions import Array
from anysim_policy.layout import Layout
from anysim_policy.spec import PolicySpec


class Sway:
    """A policy of the controller `policy`: it is told `width` [rad] and sees its clock."""

    def __init__(
        self, channel: ChannelView, *, frequency: Annotated[float, Field(gt=0, description="[Hz]")] = 0.5
    ) -> None:
        self.spec = PolicySpec.model_validate(
            {
                "model": "none",
                "observations": [{"term": "clock"}, {"term": "command"}],
                "commands": [{"name": "width", "low": 0.0, "high": 0.3}],
                "action_scale": 1.0,
                "frequency": frequency,
            }
        )
        self.layout = Layout(self.spec, channel)

    def act(self, observation: Array) -> Array:
        """Outputs (E, A) for observations (E, 3): sine and cosine of the clock, and the width."""
        sway = observation[:, 0] * observation[:, 2]
        return np.repeat(sway[:, None], len(self.layout.joints), axis=1)
