"""From the name of a builder and its parameters to a model."""

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from anysim import registry
from anysim.assets.model import ImportedModel
from anysim.assets.scaling import scaled
from anysim.errors import AssetError, PluginError, SpecError, SpecIssue
from anysim.plugin_parameters import options_model, parameters
from anysim_schemas.errors import KeyFault
from anysim_schemas.object_source import PROCEDURAL


def build(name: str, params: Mapping[str, Any], *, scale: float = 1.0) -> ImportedModel:
    """What a builder of the group `anysim.assets` makes; `scale` multiplies all lengths, as an importer's does.

    Raises:
        PluginError: there is no such builder; lists those installed.
        SpecError: parameters that are unknown, of the wrong type, or that do not fit together, with paths below
            `params`.
    """
    builder = registry.load("assets", name)
    try:
        options = options_model(builder).model_validate(dict(params))
    except ValidationError as error:
        issues = [SpecIssue("", ".".join(map(str, ("params", *e["loc"]))), e["msg"]) for e in error.errors()]
        raise SpecError(issues) from None
    try:
        model = builder(**{key: getattr(options, key) for key in parameters(builder)})
        if isinstance(model, ImportedModel):
            return scaled(model, scale)
    except ValueError as error:
        path = ".".join(("params", *error.path)) if isinstance(error, KeyFault) else "params"
        raise SpecError([SpecIssue("", path, str(error))]) from None
    raise PluginError(
        f"the builder '{name}' of {registry.distribution('assets', name)} returned a {type(model).__name__}; "
        "a builder returns an anysim.assets.model.ImportedModel"
    )


def from_uri(uri: str, *, scale: float = 1.0) -> ImportedModel:
    """The model behind `procedural:NAME`, with the builder's defaults.

    Raises:
        AssetError, PluginError: there is no such builder, or it needs parameters.
    """
    name = uri.removeprefix(PROCEDURAL)
    try:
        return build(name, {}, scale=scale)
    except SpecError as error:
        raise AssetError(
            f"asset '{uri}' needs parameters ({'; '.join(map(str, error.issues))}); "
            f"write it as `procedural: {name}` with `params`"
        ) from None
