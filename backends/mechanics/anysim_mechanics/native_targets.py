"""Targets for a library's own drives, which know stiffness and damping, such that they do what the drive law says.

Feed-forward moves the target, and a joint's own damping, which is part of its drive there, moves the velocity target.
"""

from anysim.conventions import Array
from anysim.math.compiled import compiled


@compiled
def native_targets(
    position: Array,
    velocity: Array,
    effort: Array,
    stiffness: Array,
    damping: Array,
    whole: Array,
    place: Array,
    speed: Array,
) -> None:
    """What drives are told for commands; all are (N, A).

    Args:
        position, velocity, effort: the commands.
        stiffness, damping: of the drives in their modes.
        whole: damping and the joints' own.
        place, speed: the drives' targets, written.
    """
    for env in range(position.shape[0]):
        for a in range(position.shape[1]):
            stiff = stiffness[env, a] > 0.0
            place[env, a] = position[env, a] + (effort[env, a] / stiffness[env, a] if stiff else 0.0)
            push = damping[env, a] * velocity[env, a] + (0.0 if stiff else effort[env, a])
            speed[env, a] = push / whole[env, a] if whole[env, a] > 0.0 else 0.0
