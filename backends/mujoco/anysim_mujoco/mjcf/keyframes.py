"""Keyframes of an MJCF file: named positions of its joints."""

from pathlib import Path

import mujoco

from anysim_mujoco.mjcf.file import compiled

_SLIDE, _HINGE = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)


def keyframes(file: Path) -> dict[str, dict[str, float]]:
    """Joint positions [rad, m] of each keyframe by joint name, in the file's order; without free joints and followers.

    A keyframe without a name has its number. A robot in the catalogue takes one as its `home`:
    `simulation.add_robot("arm", "arm.yaml", home=keyframes(file)["ready"])`.

    Raises:
        AssetError: there is no such file, or MuJoCo cannot read it.
    """
    model = compiled(file, file.parent)
    coupled = model.eq_type == mujoco.mjtEq.mjEQ_JOINT
    followers = {
        int(j) for j, other in zip(model.eq_obj1id[coupled], model.eq_obj2id[coupled], strict=True) if other >= 0
    }
    own = [j for j in range(model.njnt) if model.joint(j).name and j not in followers]
    scalar = [j for j in own if int(model.jnt_type[j]) in (_SLIDE, _HINGE)]
    return {
        model.key(k).name or str(k): {
            str(model.joint(j).name): float(model.key_qpos[k][model.jnt_qposadr[j]]) for j in scalar
        }
        for k in range(model.nkey)
    }
