"""Term functions by name, and their binding to a scene."""

import inspect
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from types import ModuleType
from typing import Any

from anysim import registry
from anysim.errors import AnysimError, PluginError, SpecError, SpecIssue, listing, suggest
from anysim.plugin_parameters import checked, given, options_model, parameters, reference_kind
from anysim.task.contract import GOES_ON
from anysim.task.references import Conditions
from anysim.task.scene import Frame, RobotView, SceneView
from anysim_schemas.task import PredicateTermSpec, TermSpec

BUILTIN = "anysim"


def _functions(library: str, kind: str) -> Mapping[str, Callable[..., Any]]:
    """The terms of one kind in a library: entry point `anysim.terms`, attribute TERMS[kind], a module or a mapping."""
    tables = getattr(registry.load("terms", library), "TERMS", None)
    if not isinstance(tables, Mapping):
        raise PluginError(
            f"the term library '{library}' of {registry.distribution('terms', library)} has no TERMS mapping"
        )
    table = tables.get(kind, {})
    return {name: getattr(table, name) for name in table.__all__} if isinstance(table, ModuleType) else table


def find(kind: str, name: str) -> Callable[..., Any]:
    """The function of a term: `near` is built in, `library.near` is of an installed library.

    Raises:
        PluginError: there is none; lists what exists.
    """
    library, _, bare = name.rpartition(".")
    functions = _functions(library or BUILTIN, kind)
    if bare not in functions:
        others = [lib for lib in registry.names("terms") if lib != BUILTIN and bare in _functions(lib, kind)]
        hint = f"; did you mean '{others[0]}.{bare}'?" if others else suggest(bare, list(functions))
        raise PluginError(f"no {kind} term is named '{name}'{hint} ({kind} terms: {listing(functions, 30)})")
    return functions[bare]


def goes_on(kind: str, spec: TermSpec) -> int | None:
    """How many numbers the goals have of a command, or an event, that is called in each step; None for the others."""
    with suppress(AnysimError):  # of a term that there is not `bind` tells
        return vars(find(kind, spec.term)).get(GOES_ON)


def term_names(library: str) -> list[str]:
    """The terms of a library, as `kind name`, in order."""
    tables = registry.load("terms", library).TERMS
    return [f"{kind} {name}" for kind in tables for name in sorted(_functions(library, kind))]


def bind(kind: str, term: str, params: Mapping[str, Any], scene: SceneView, path: str) -> Callable[..., Any]:
    """The term as a function of its positional arguments after `scene`, with parameters checked and names resolved.

    A class is a term that remembers: it is made with the scene and its parameters, and its instance is the function.

    Raises:
        SpecError: at `path`, a parameter is wrong, or names nothing in this world.
    """
    return bind_function(find(kind, term), f"term '{term}'", params, scene, path)


def bind_function(
    function: Callable[..., Any], what: str, params: Mapping[str, Any], scene: SceneView, path: str
) -> Callable[..., Any]:
    """As `bind`, for a function that is found already; `what` it is, for errors."""
    with registry.Blame(f"{path}: the signature of the {what}", registry.origin(function)):
        model = options_model(function)
    values = checked(model, params, path)
    keywords: dict[str, Any] = {}
    for name, parameter in parameters(function).items():
        value = getattr(values, name)
        view = given(parameter.annotation)
        if view is Conditions and value is not None:
            value = _conditions(value, scene, f"{path}.{name}")
        elif reference_kind(view) is not None:
            try:
                value = resolve(view, value, scene)
            except AnysimError as error:
                raise SpecError([SpecIssue("", f"{path}.{name}", str(error))]) from None
        keywords[name] = value
    made = partial(function, scene, **keywords)
    return made() if inspect.isclass(function) else made


def _conditions(specs: Mapping[str, PredicateTermSpec], scene: SceneView, path: str) -> Conditions:
    """Predicates inside one; SpecError with the faults of all of them."""
    calls: list[Callable[..., Any]] = []
    issues: list[SpecIssue] = []
    for key, spec in specs.items():
        try:
            calls.append(bind("predicate", spec.term, spec.params, scene, f"{path}.{key}"))
        except SpecError as error:
            issues.extend(error.issues)
    if issues:
        raise SpecError(issues)
    return Conditions(calls)


def resolve(view: object, name: object, scene: SceneView) -> object:
    """The handle that a reference in a YAML file stands for; `view` is its class. None for one that was left out."""
    view = getattr(view, "__origin__", view)  # of one that is annotated
    if view is RobotView:
        return scene.robot(scene.index.robot(None if name is None else str(name)).name)
    if name is None:
        return None
    if view is Frame:
        return scene.frame(str(name))
    assert isinstance(view, type)
    return view(scene, name)
