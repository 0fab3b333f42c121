"""The models of options that plugins own, for the loader of specs."""

from pydantic import BaseModel, ConfigDict

from anysim import registry
from anysim.controllers.base import DEFAULT_CONTROLLER
from anysim.errors import PluginError
from anysim.plugin_parameters import options_model
from anysim_schemas.plugin import UnknownPlugin

TERM_KINDS = ("observation", "reward", "predicate", "command", "event")


class _Anything(BaseModel):
    """Options that somebody else checks."""

    model_config = ConfigDict(extra="allow")


def resolve_options(kind: str, name: str) -> type[BaseModel] | None:
    """The options model of a plugin by slot kind and name; see `anysim_schemas.plugin`.

    Raises:
        UnknownPlugin: with a sentence that lists what exists.
    """
    from anysim.task.term_registry import find

    try:
        if (kind, name) == ("controller", DEFAULT_CONTROLLER):
            return _Anything
        if kind in TERM_KINDS:
            return options_model(find(kind, name))
        if kind in ("engine", "writer"):
            return registry.load(f"{kind}s", name).options_model()
        return options_model(registry.load(f"{kind}s", name))
    except PluginError as error:
        raise UnknownPlugin(str(error)) from error
