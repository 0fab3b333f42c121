"""Orders of annotators: names, with their parameters, as commands and programs give them."""

from collections.abc import Mapping
from typing import Any

import yaml

from anysim import registry
from anysim.errors import AnysimError, SpecError, SpecIssue, listing
from anysim.plugin_parameters import checked, options_model, parameters
from anysim_annotation.api import Annotator, SegmentAnnotator
from anysim_annotation.view import Scene

Orders = Mapping[str, Mapping[str, Any]]
"""Parameters of annotators, by name."""


def read_orders(text: str) -> Orders:
    """Annotators as a command names them: `boxes_2d,normals`, or `{point_cloud: {stride: 2}, normals: {}}`.

    Raises:
        SpecError: it is neither, or names none.
    """
    try:
        found = yaml.safe_load(text) if text.lstrip().startswith("{") else dict.fromkeys(text.split(","))
    except yaml.YAMLError as error:
        raise SpecError([SpecIssue("", "annotate", f"is no mapping: {error}")]) from None
    orders = {str(name).strip(): dict(params or {}) for name, params in found.items() if str(name).strip()}
    if not orders:
        names = listing(registry.names("annotators"))
        raise SpecError([SpecIssue("", "annotate", f"names no annotator (installed: {names})")])
    for name, params in orders.items():
        checked(options_model(registry.load("annotators", name)), params, f"annotate.{name}")
    return orders


def make_annotator(name: str, params: Mapping[str, Any], scene: Scene) -> Annotator | SegmentAnnotator:
    """An annotator of a camera, with its parameters checked.

    Raises:
        PluginError: it is not installed, or fails.
        SpecError: at a parameter, what is wrong with it.
    """
    made: Any = registry.load("annotators", name)
    values = checked(options_model(made), params, f"annotate.{name}")
    with registry.using("annotators", name):
        found = made(scene, **{key: getattr(values, key) for key in parameters(made)})
    if not isinstance(found, Annotator | SegmentAnnotator):
        raise AnysimError(
            f"the annotator '{name}' of {registry.distribution('annotators', name)} is a {type(found).__name__}; "
            "derive it from anysim_annotation.api.Annotator or SegmentAnnotator"
        )
    return found
