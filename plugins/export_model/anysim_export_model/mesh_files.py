"""Meshes as files beside a model: triangles as text, every digit of them."""

import re
from pathlib import Path

import numpy as np

from anysim.model.world import Mesh

FOLDER = "meshes"


class MeshFiles:
    """The meshes that a model refers to, each written once when it is asked for."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / FOLDER
        self._names: dict[str, str] = {}
        self.written: list[Path] = []

    def file(self, mesh: Mesh) -> str:
        """The path of a mesh's file, relative to the model's."""
        if mesh.name not in self._names:
            plain = re.sub(r"[^\w.-]", "_", mesh.name).strip(".") or "mesh"
            name, count = plain, 0
            while name in self._names.values():
                count += 1
                name = f"{plain}_{count}"
            self._names[mesh.name] = name
            self._folder.mkdir(parents=True, exist_ok=True)
            path = self._folder / f"{name}.obj"
            path.write_text(_obj(mesh), encoding="utf-8")
            self.written.append(path)
        return f"{FOLDER}/{self._names[mesh.name]}.obj"


def _obj(mesh: Mesh) -> str:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(mesh.vertices, dtype=float).tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (np.asarray(mesh.faces, dtype=int) + 1).tolist()]
    return "\n".join([*lines, ""])
