"""Hyperparameters that learners share."""

from typing import Annotated

from pydantic import Field

RolloutSteps = Annotated[int, Field(ge=2, description="control steps of each env between two updates")]
Epochs = Annotated[int, Field(ge=1, description="how often a rollout is learnt from")]
Discount = Annotated[float, Field(gt=0, le=1, description="of a reward a control step later")]
TraceDecay = Annotated[float, Field(ge=0, le=1, description="of generalised advantages (Schulman et al. 2016)")]
Entropy = Annotated[float, Field(ge=0, description="how much noise itself is worth")]
Width = Annotated[int, Field(ge=1, description="of the two hidden layers")]
Noise = Annotated[float, Field(gt=0, description="initial deviation of actions, in half ranges")]
