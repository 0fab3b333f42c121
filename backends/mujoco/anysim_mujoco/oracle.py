"""An MJCF file as MuJoCo itself moves it: what the importer's reading of the file is held against."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from anysim.conventions import Array
from anysim.errors import AssetError
from anysim_mujoco.mjcf.file import compiled


class Mjcf:
    """See `anysim_robots.qualify.oracle.Oracle`. Positions of joints are those of the file, `ref` and all."""

    name = "raw MuJoCo"

    def __init__(self, path: Path, root: Path, body: str = "") -> None:
        self._model: Any = compiled(path, root, body)
        self._data: Any = mujoco.MjData(self._model)
        model = self._model
        single = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
        self.joints: int | None = sum(int(kind) in single for kind in model.jnt_type)
        tops = [i for i in range(1, model.nbody) if model.body_parentid[i] == 0]
        if not tops:
            raise AssetError(f"{path}: has no body")
        self.root = model.body(tops[0]).name or f"body{tops[0]}"
        moved = model.body_jntnum[tops[0]] and int(model.jnt_type[model.body_jntadr[tops[0]]]) in single
        if moved:
            self.root = ""  # the tree stands on the file's origin
        self.mass: float | None = float(model.body_mass[1:].sum())
        self.followers: Mapping[str, Any] = {}  # the World's mimics are given as joint positions

    def frames(self, joint_pos: Mapping[str, float]) -> Mapping[str, Array]:
        model, data = self._model, self._data
        for j in range(model.njnt):
            name = model.joint(j).name or f"joint{j}"
            if name in joint_pos:
                data.qpos[model.jnt_qposadr[j]] = joint_pos[name]
        mujoco.mj_kinematics(model, data)
        return {
            model.body(i).name or f"body{i}": np.concatenate([data.xpos[i], np.roll(data.xquat[i], -1)])
            for i in range(1, model.nbody)
        }
