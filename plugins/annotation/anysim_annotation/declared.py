"""Checks of labels against what their annotator declares, at each moment: shapes, number types and keys."""

import numpy as np

from anysim import registry
from anysim.errors import PluginFailure
from anysim_annotation.api import Annotator, Field, Labels
from anysim_annotation.view import View


def check_labels(name: str, annotator: Annotator, labels: Labels, view: View) -> None:
    """See that labels are those that were declared.

    Raises:
        PluginFailure: names, shapes, number types or keys differ.
    """
    if labels.arrays.keys() != annotator.arrays.keys():
        _fail(name, f"made the arrays {sorted(labels.arrays)}, and declares {sorted(annotator.arrays)}")
    for key, rows in labels.arrays.items():
        if len(rows) != len(view):
            _fail(name, f"made {len(rows)} arrays '{key}' of {len(view)} envs")
    for row in range(len(view)):
        sizes = {"H": view.scene.height, "W": view.scene.width}
        for key, field in annotator.arrays.items():
            array = labels.arrays[key][row]
            if not _fits(array.shape, field, sizes) or array.dtype != np.dtype(field.dtype):
                said = f"{field.shape} of {field.dtype}"
                _fail(name, f"made '{key}' of shape {array.shape} of {array.dtype}, and declares {said}")
    if len(labels.records) != len(view):
        _fail(name, f"made records of {len(labels.records)} of {len(view)} envs")
    for rows in labels.records:
        for record in rows:
            if record.keys() != annotator.records.keys():
                _fail(name, f"made a record of {sorted(record)}, and declares {sorted(annotator.records)}")


def _fits(shape: tuple[int, ...], field: Field, sizes: dict[str, int]) -> bool:
    """Whether a shape is the declared one; letters get their sizes here."""
    if len(shape) != len(field.shape):
        return False
    return all(
        size == (sizes.setdefault(said, size) if isinstance(said, str) else said)
        for size, said in zip(shape, field.shape, strict=True)
    )


def _fail(name: str, words: str) -> None:
    package = registry.distribution("annotators", name)
    raise PluginFailure(f"the annotator '{name}' of {package} {words}; repair it")
