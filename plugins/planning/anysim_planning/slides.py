"""Tools that may slide: joints that nothing has, between an arm and the pose that its tool is asked for."""

from dataclasses import replace

import numpy as np

from anysim.conventions import IDENTITY_QUATERNION
from anysim.kinematics.chain import Chain
from anysim.math import pose as P

_NONE = P.pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION)


def sliding(chain: Chain, lengths: tuple[float, float, float]) -> Chain:
    """A chain whose tool also slides along its own axes, by at most these lengths [m] to either side.

    The further columns come last. A solver that brings this tool to a pose has the true one beside it, turned as asked.
    """
    axes = [k for k in range(3) if lengths[k] > 0.0]
    if not axes:
        return chain
    count, most = len(axes), np.array([lengths[k] for k in axes])
    return replace(
        chain,
        name=f"{chain.name}, sliding",
        joints=np.append(chain.joints, np.full(count, -1)),
        joint_names=(*chain.joint_names, *(f"slide {'xyz'[k]}" for k in axes)),
        prismatic=np.append(chain.prismatic, np.ones(count, dtype=bool)),
        rest=np.concatenate([chain.rest, [chain.tool_offset], np.tile(_NONE, (count - 1, 1))]),
        anchor=np.concatenate([chain.anchor, np.zeros((count, 3))]),
        axis=np.concatenate([chain.axis, np.eye(3)[axes]]),
        lower=np.append(chain.lower, -most),
        upper=np.append(chain.upper, most),
        velocity_limit=np.append(chain.velocity_limit, np.full(count, np.inf)),
        initial=np.append(chain.initial, np.zeros(count)),
        tool_offset=_NONE,
    )
