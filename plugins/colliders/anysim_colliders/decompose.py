"""Convex pieces of meshes, by CoACD, cached by the content of the mesh and the parameters."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Collection
from dataclasses import replace
from functools import partial
from importlib import metadata, util
from pathlib import Path

import numpy as np

from anysim import cache
from anysim.assets.meshes import HULL_VERTICES, WholeMesh
from anysim.assets.model import ImportedModel
from anysim.conventions import Array
from anysim.errors import AssetError
from anysim.geometry.triangles import convex_hull
from anysim.kinematics import inertia
from anysim.model.world import Mesh, MeshShape
from anysim.threads import usable_cores
from anysim_colliders import coacd_child
from anysim_colliders.replacing import Collider, Substitute, replaced, volume_words
from anysim_schemas.collision_shapes import CollisionShapesSpec

SECONDS = 900
"""What the decomposition of one mesh may take."""
_VERSION = "anysim-pieces-1"  # change with anything that changes the result


def decomposed(model: ImportedModel, spec: CollisionShapesSpec, kept: Collection[str]) -> ImportedModel:
    """The model whose meshes collide as convex pieces.

    Raises:
        AssetError: CoACD is not installed, or finds no pieces.
    """
    return replaced(model, kept, partial(_made, spec))


def _made(spec: CollisionShapesSpec, hull: Mesh, whole: WholeMesh) -> Substitute:
    found = pieces(whole.mesh(), spec.concavity, spec.pieces)
    named = [replace(mesh, name=f"{hull.name}_{number}") for number, mesh in enumerate(found)]
    volume = sum(inertia.volume(MeshShape(mesh.name), {mesh.name: mesh}) for mesh in named)
    colliders = tuple(Collider(MeshShape(mesh.name), mesh=mesh) for mesh in named)
    many = "one convex piece" if len(named) == 1 else f"{len(named)} convex pieces"
    return Substitute(colliders, f"{many}: {volume_words(volume, hull, whole)}")


def pieces(mesh: Mesh, concavity: float, most: int, *, threads: int | None = None) -> tuple[Mesh, ...]:
    """At most `most` convex pieces of a mesh, each of at most `HULL_VERTICES` corners.

    Args:
        mesh: its `hash` stands for its content.
        concavity: how far the surface of a piece may be off its hull, as a share of half the mesh's longest side.
        most: where more would be needed, the nearest are joined.
        threads: those of the processors that this process may use, where not given; changes no bit of the result.

    Raises:
        AssetError: CoACD is not installed, or finds no pieces.
    """
    if util.find_spec("coacd") is None:
        raise AssetError("`collision: decompose` needs the package coacd: pip install 'anysim-colliders[coacd]'")
    key = cache.digest(_VERSION, metadata.version("coacd"), mesh.hash, repr(concavity), str(most), str(HULL_VERTICES))

    def make() -> dict[str, Array]:
        arrays: dict[str, Array] = {}
        for i, corners in enumerate(_corners(mesh, concavity, most, threads or usable_cores())):
            arrays[f"{i}/vertices"], arrays[f"{i}/faces"] = convex_hull(corners, HULL_VERTICES)
        return arrays

    arrays = cache.load_or_make("colliders", key, make)
    return tuple(_mesh(mesh.name, cache.digest(key, str(i)), arrays, i) for i in range(len(arrays) // 2))


def _mesh(name: str, key: str, arrays: dict[str, Array], number: int) -> Mesh:
    vertices = np.ascontiguousarray(arrays[f"{number}/vertices"], dtype=np.float64)
    faces = np.ascontiguousarray(arrays[f"{number}/faces"], dtype=np.int32)
    vertices.setflags(write=False)
    faces.setflags(write=False)
    return Mesh(f"{name}_{number}", vertices, faces, key)


def _corners(mesh: Mesh, concavity: float, most: int, threads: int) -> list[Array]:
    """The corners (K, 3) of each piece.

    From a process of its own: threads are counted at its start, and a mesh that CoACD cannot take may end it.
    """
    with tempfile.TemporaryDirectory(prefix="anysim-colliders-") as folder:
        order, answer = Path(folder) / "order.npz", Path(folder) / "answer.npz"
        numbers = np.array([concavity, most, HULL_VERTICES], dtype=float)
        np.savez(order, vertices=np.asarray(mesh.vertices), faces=np.asarray(mesh.faces), numbers=numbers)
        command = [sys.executable, str(Path(coacd_child.__file__)), str(order), str(answer)]
        environment = os.environ | {"OMP_NUM_THREADS": str(threads)}
        try:
            done = subprocess.run(command, env=environment, capture_output=True, timeout=SECONDS, check=False)
        except subprocess.TimeoutExpired:
            raise AssetError(
                f"mesh '{mesh.name}': its convex decomposition took more than {SECONDS} s; raise `concavity`, or give "
                f"a mesh of fewer triangles than {len(mesh.faces)}"
            ) from None
        if done.returncode or not answer.exists():
            said = done.stderr.decode(errors="replace").strip().splitlines()
            why = said[-1][:200] if said else f"it ended with {done.returncode}"
            raise AssetError(f"mesh '{mesh.name}' cannot be decomposed by CoACD: {why}")
        with np.load(answer) as arrays:
            found = [arrays[f"{i}"] for i in range(len(arrays.files))]
    if not found:
        raise AssetError(f"mesh '{mesh.name}' cannot be decomposed by CoACD: it finds no pieces")
    return found
