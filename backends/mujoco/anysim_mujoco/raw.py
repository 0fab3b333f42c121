"""MuJoCo's own loop over the same envs, which the engine is measured against."""

from collections.abc import Callable, Sequence
from itertools import cycle
from typing import Any

import mujoco
from mujoco.batch import Batch

from anysim.conventions import Array

_READ = ("qpos", "qvel", "xpos", "xquat", "cvel")


def raw_loop(batch: Any, inputs: Sequence[Array]) -> Callable[[int], None]:
    """A function of the number of physics steps: write a control input, step a private batch, copy the state out.

    `inputs` (N, A) are written in turn.
    """
    own = Batch(batch.model, batch.nsim, nthread=batch.nthread)
    for name, values in batch._expanded.items():  # noqa: SLF001  mujoco offers no list of the expanded fields
        own.expand(name)[...] = values
    if batch._expanded:  # noqa: SLF001
        own.set_const()
    own.state[...] = batch.state
    control, turns = own.bind("ctrl"), cycle(inputs)
    arrays = [own.bind(name) for name in _READ]
    stage = mujoco.mjtStage.mjSTAGE_VEL.value

    def loop(steps: int) -> None:
        control[...] = next(turns)
        own.step(nstep=steps, stage=stage)
        for array in arrays:
            array.copy()

    return loop
