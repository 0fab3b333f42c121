"""Rollouts: a private batch of the same world on MuJoCo, where a skill tries out what it might do.

Whatever engine runs the episode, the batch takes over the state of one of its envs by name and goes on from there: the
same bodies, joints, commands and changed parameters, but not the same bits. Nothing is ever written back.
"""

import weakref

import numpy as np

from anysim.conventions import Array
from anysim.engine.factory import create_simulation
from anysim.task.env import TaskEnv

ENGINE = "mujoco"


class Rollouts:
    """A batch of `samples` copies of one env.

    Attributes:
        samples: how many.
        substeps: physics steps of a control step.
    """

    def __init__(self, env: TaskEnv, samples: int) -> None:
        """Raises PluginError or EngineError where MuJoCo is not installed or does not run this world."""
        self.env, self.samples = env, samples
        self.substeps = env.engine.world.physics.substeps
        self._engine = create_simulation(ENGINE)
        self._end = weakref.finalize(self, self._engine.destroy)
        self._engine.create_world(env.engine.world, samples)
        self._position = np.zeros((samples, len(env.engine.world.actuators)))

    def close(self) -> None:
        """Free the engine; it is freed with this object at the latest."""
        self._end()

    def begin(self, env_id: int) -> None:
        """All samples are where this env is now."""
        state = self.env.engine.world_state([env_id]).rows([0] * self.samples)
        self._engine.set_world_state(state, missing="keep")  # MuJoCo may lack a parameter that was changed
        self._position[:] = self._engine.control.position

    def step(self, drives: Array, targets: Array) -> None:
        """One control step with position targets (samples, k) of some drives [rad, m]; the others keep theirs."""
        self._position[:, drives] = targets
        self._engine.set_control(position=self._position)
        self._engine.step(self.substeps)

    def positions(self, body: int) -> Array:
        """(samples, 3) [m] of a body of the world."""
        return self._engine.get_state().body_pose[:, body, :3]
