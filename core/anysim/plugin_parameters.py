"""Parameters of plugins from their signatures: keyword-only arguments become a pydantic model.

A function or class takes its positional arguments from anysim and its keyword-only ones from the YAML file. Their
annotations are checked when the file is loaded; an annotation with an attribute `reference_kind` (a handle such as
`Frame`) is written as a name in the file, or as its attribute `written_as` says, and resolved when the env is built. A
constructor that takes `**options` and
hands them on to the constructor of its base has the parameters of that one too, before its own.
"""

import inspect
from collections.abc import Callable, Mapping
from functools import cache
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError, create_model

from anysim.errors import SpecError, SpecIssue
from anysim_schemas.base import Reference
from anysim_schemas.faults import UNKNOWN_KEY
from anysim_schemas.messages import sentence, unknown_key


@cache
def parameters(function: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """The keyword-only parameters, with resolved annotations."""
    hinted = function.__init__ if inspect.isclass(function) else function
    hints = get_type_hints(hinted, include_extras=True)
    every = inspect.signature(hinted).parameters
    found = {
        name: p.replace(annotation=hints.get(name, Any))
        for name, p in every.items()
        if p.kind is inspect.Parameter.KEYWORD_ONLY
    }
    if inspect.isclass(function) and any(p.kind is inspect.Parameter.VAR_KEYWORD for p in every.values()):
        made = [c for c in function.__mro__[:-1] if "__init__" in vars(c)]  # object's takes none
        found = {**(parameters(made[1]) if len(made) > 1 else {}), **found}
    return found


def reference_kind(annotation: Any) -> str | None:
    """The kind of handle an annotation stands for, or None for plain data. `Frame | None` may be left out."""
    return getattr(given(annotation), "reference_kind", None)


def given(annotation: object) -> object:
    """The annotation of a value that is given."""
    parts = get_args(annotation) if get_origin(annotation) in (Union, UnionType) else ()
    return parts[0] if len(parts) == 2 and parts[1] is NoneType else annotation


@cache
def options_model(function: Callable[..., Any]) -> type[BaseModel]:
    """A frozen, closed pydantic model of the keyword-only parameters."""
    fields: dict[str, Any] = {}
    reference: Any = Reference
    for name, p in parameters(function).items():
        kind = reference_kind(p.annotation)
        if kind == "robot":  # the only robot of a world need not be named
            fields[name] = (reference | None, None)
        else:
            bare = given(p.annotation)
            annotation = getattr(bare, "written_as", reference) if kind else p.annotation
            annotation = annotation | None if kind and bare is not p.annotation else annotation
            fields[name] = (annotation, ... if p.default is inspect.Parameter.empty else p.default)
    config = ConfigDict(extra="forbid", frozen=True)
    return create_model(getattr(function, "__name__", "options"), __config__=config, **fields)


def checked(model: type[BaseModel], params: Mapping[str, Any], path: str) -> BaseModel:
    """The parameters by their model.

    Raises:
        SpecError: at their keys below `path`, what is wrong with them.
    """
    try:
        return model.model_validate(dict(params))
    except ValidationError as error:
        issues = [
            SpecIssue(
                "",
                ".".join(map(str, (path, *e["loc"]))),
                unknown_key(str(e["loc"][0]), list(model.model_fields), {})
                if e["type"] == UNKNOWN_KEY and len(e["loc"]) == 1
                else sentence(e["type"], e.get("ctx", {}), e["input"], e["msg"]),
            )
            for e in error.errors()
        ]
        raise SpecError(issues) from None
