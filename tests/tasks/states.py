"""Setting and judging states of a task: what the tests of the catalogue are made of."""

import numpy as np

import anysim
from anysim.api import load
from anysim.conventions import Array
from anysim.model.world import BodyKind
from anysim.task.env import TaskEnv
from anysim.task.joints import RangedJointView


def blind(task: str, engine: str, num_envs: int = 2, *overrides: str, robot: str | None = None) -> TaskEnv:
    """A task without its cameras, with the robot in the place of its own."""
    changes = [*blinding(task), *overrides]
    return anysim.make(task, engine=engine, num_envs=num_envs, robot=robot, overrides=changes)


def blinding(task: str) -> list[str]:
    """Overrides by which a task's cameras draw nothing."""
    return ["record.cameras=[]", *(f"world.cameras.{name}.channels=[]" for name in load(task).spec.world.cameras)]


def put(env: TaskEnv, name: str, pose: Array) -> None:
    """Put an object at poses (N, 7), at rest."""
    root = env.engine.index.entity(name).root
    moves = env.engine.world.bodies[root].kind is BodyKind.FREE
    env.engine.set_body_state(pose[:, None], np.zeros((len(pose), 1, 6)) if moves else None, None, [root])
    env.scene.look(None)


def set_opening(env: TaskEnv, name: str, share: float, speed: float = 0.0) -> None:
    """Open a joint by a share of its range, at rest unless a speed [rad/s, m/s] is given."""
    joint = RangedJointView(env.scene, name)
    low, high = joint.found[0].lower, joint.found[0].upper
    set_joint(env, joint.found[0].name, low + share * (high - low), speed)


def set_joint(env: TaskEnv, name: str, position: float, speed: float = 0.0) -> None:
    """Put a joint at a position [rad, m], at rest unless a speed [rad/s, m/s] is given."""
    column = np.full((env.num_envs, 1), position)
    env.engine.set_joint_state(column, np.full_like(column, speed), None, [env.engine.index.joint(name)])
    env.scene.look(None)


def seen(env: TaskEnv, frame: str) -> Array:
    """The poses (N, 7) of a frame."""
    env.scene.look(None)
    return env.scene.frame(frame).pose.copy()


def offset(pose: Array, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Array:
    """The poses moved in the world's axes."""
    return pose + np.array([x, y, z, 0.0, 0.0, 0.0, 0.0])


def level(pose: Array, like: Array) -> Array:
    """Positions of the one, orientations of the other."""
    return np.concatenate([pose[:, :3], np.broadcast_to(like[:, 3:], (len(pose), 4))], axis=1)


def judged(env: TaskEnv) -> Array:
    """(N,) whether the episode would be a success, had this state held as long as it must."""
    assert env.spec.task is not None
    env.scene.look(None)
    env.mdp.held[:] = 0
    for _ in range(env.spec.task.hold):
        success, _ = env.mdp.judge()
    env.mdp.held[:] = 0
    return success


def failed(env: TaskEnv) -> Array:
    """(N,) whether the episode would end as a failure."""
    env.scene.look(None)
    return env.mdp.judge()[1]


def rewarded(env: TaskEnv) -> Array:
    """(N,) the reward of this state."""
    env.scene.look(None)
    return env.mdp.reward(np.zeros(env.num_envs, dtype=bool))
