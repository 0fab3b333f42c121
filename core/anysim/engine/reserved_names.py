"""Names that the base classes of engines keep for themselves: an engine that takes one of them is refused by name.

A class is judged when it is made, by its own names and by what its methods assign to `self`. What cannot be seen there
(`setattr`, a mixin) is found right after a build. Nothing is done in a step.
"""

import dis
from collections.abc import Iterator, Mapping
from functools import cache
from types import CodeType, FunctionType
from typing import Any, NoReturn

from anysim.engine.primitives import Primitives
from anysim.errors import EngineError

_PACKAGES = ("anysim.engine.", "anysim_mechanics.")  # of the base classes
_STORE = bytes([dis.opmap["STORE_ATTR"]])


def check_class(engine: type) -> None:
    """Refuse a class of another package that has a private name of the base classes, or assigns an attribute of theirs.

    Raises:
        EngineError: it does; the message names it, the class and the base that owns it.
    """
    if engine.__module__.startswith(_PACKAGES):
        return
    taken = reserved(engine)
    for name, value in vars(engine).items():
        if name.startswith("_") and name in taken:
            _refuse(engine, name, taken[name], "defines")
        for assigned in _assigned(value):
            if assigned in taken:
                _refuse(engine, assigned, taken[assigned], f"assigns, in {name}(),")


def check_instance(engine: object, kept: Mapping[str, object]) -> None:
    """Refuse an engine that has replaced an attribute of the base classes since `kept`, its attributes then.

    Raises:
        EngineError: it has, or it hides a method of theirs.
    """
    taken = {} if type(engine).__module__.startswith(_PACKAGES) else reserved(type(engine))
    for name, value in vars(engine).items():
        replaced = kept.get(name, value) is not value
        hides = name not in kept and hasattr(type(engine), name)
        if name in taken and (replaced or hides):
            _refuse(type(engine), name, taken[name], "assigns")


def reserved(engine: type) -> dict[str, str]:
    """Private methods of an engine's base classes and all attributes of its instances that are theirs, with the owner.

    Primitives are not among them, nor what is abstract: those are for engines to write. Nor is what an engine that
    others are derived from has: that is its own affair.
    """
    names: dict[str, str] = {}
    for base in reversed(engine.__mro__):
        ours = base.__module__.startswith(_PACKAGES) and base is not Primitives
        if ours and not isinstance(vars(base).get("name"), str):
            names |= dict.fromkeys(_own(base) - names.keys(), base.__name__)
    return names


@cache
def _own(base: type) -> frozenset[str]:
    names: set[str] = set()
    for name, value in vars(base).items():
        to_be_written = name in vars(Primitives) or getattr(value, "__isabstractmethod__", False)
        if name.startswith("_") and not name.endswith("_") and hasattr(value, "__get__") and not to_be_written:
            names.add(name)
        names.update(_assigned(value))
    return frozenset(names)


def _assigned(value: object) -> Iterator[str]:
    """The attributes that a method assigns to its first argument, also in functions inside of it."""
    parts = (value.fget, value.fset) if isinstance(value, property) else (getattr(value, "__func__", value),)
    for function in parts:
        if isinstance(function, FunctionType) and function.__code__.co_argcount:
            yield from _stored(function.__code__, function.__code__.co_varnames[0])


def _stored(code: CodeType, itself: str) -> Iterator[str]:
    before: Any = None
    for instruction in dis.get_instructions(code) if _STORE in code.co_code[::2] else ():
        pair = isinstance(before, tuple) and before[-1:] == (itself,)  # some versions load value and object at once
        if instruction.opname == "STORE_ATTR" and (before == itself or pair):
            yield instruction.argval
        before = instruction.argval
    for constant in code.co_consts:
        if isinstance(constant, CodeType) and itself in constant.co_freevars:
            yield from _stored(constant, itself)


def _refuse(engine: type, name: str, owner: str, does: str) -> NoReturn:
    raise EngineError(
        f"{engine.__module__}.{engine.__qualname__} {does} '{name}', which belongs to {owner}, a base class of all "
        f"engines; give it another name (docs/write_an_engine.md lists those that are taken)"
    )
