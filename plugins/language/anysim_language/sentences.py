"""Sentences from templates: Jinja2 with strict names, articles, lists and numbers in words."""

import re
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

from jinja2 import Environment, StrictUndefined, Template, TemplateError, meta

from anysim.errors import PluginError

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
_VOWEL_SOUND = re.compile(r"[aeio]|un(?!i)|u(?!n)|x[A-Z]|[AEFHILMNORSX][A-Z0-9]")
_NO_VOWEL_SOUND = re.compile(r"one\b|once\b|eu|us(?:e|b)|uti")


def article(phrase: str) -> str:
    """`a` or `an`, by how the phrase sounds."""
    lowered = phrase.lower()
    if _NO_VOWEL_SOUND.match(lowered):
        return "a"
    return "an" if _VOWEL_SOUND.match(phrase) or lowered[:1] in "aeio" else "a"


def indefinite(phrase: str) -> str:
    """`a red cube`."""
    return f"{article(phrase)} {phrase}"


def capital(text: str) -> str:
    """With a capital first letter; the others as they are."""
    return text[:1].upper() + text[1:]


def listed(words: Iterable[str]) -> str:
    """`a, b and c`."""
    several = list(words)
    return several[0] if len(several) == 1 else f"{', '.join(several[:-1])} and {several[-1]}" if several else "nothing"


def counted(number: int) -> str:
    """In words up to twelve."""
    return NUMBERS[number] if 0 <= number < len(NUMBERS) else str(number)


@cache
def _environment() -> Environment:
    made = Environment(undefined=StrictUndefined, autoescape=False, keep_trailing_newline=False)
    made.filters.update(capital=capital, listing=listed, number=counted, a=indefinite)
    return made


@cache
def _template(text: str) -> tuple[Template, frozenset[str]]:
    parsed = _environment().parse(text)
    return _environment().from_string(text), frozenset(meta.find_undeclared_variables(parsed))


def render(text: str, values: Mapping[str, Any], optional: bool = False) -> str:
    """A template with its values.

    Args:
        text: the template.
        values: by name; functions too.
        optional: a name without a value is None, in place of an error.

    Raises:
        PluginError: the template is none, or uses a name that has no value.
    """
    try:
        template, names = _template(text)
        known = {name: None for name in names if name not in values} if optional else {}
        return template.render({**known, **values})
    except TemplateError as error:
        raise PluginError(
            f"the template {text!r} of a vocabulary cannot be filled in: {error} "
            f"(values: {', '.join(sorted(values))}); repair it in the vocabulary's file"
        ) from error
