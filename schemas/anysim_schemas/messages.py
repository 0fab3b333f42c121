"""Sentences for people in place of pydantic's: what is wrong, what was expected, what was given."""

import difflib
import re
from collections.abc import Mapping, Sequence
from typing import Any, get_args

from pydantic_core import core_schema

from anysim_schemas.base import NAME_PATTERN, REFERENCE_PATTERN

PATTERNS = {
    NAME_PATTERN: "a name starts with a letter and has only letters, digits and underscores",
    REFERENCE_PATTERN: "a reference is a name, or names joined by dots, such as panda.tool, or by a slash: block/mouth",
}
"""Patterns that have a name of their own."""

EXPECTED: Mapping[str, str] = {
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number"),
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("string_type", "bytes_type", "path_type"), "text"),
    **dict.fromkeys(
        ("tuple_type", "list_type", "set_type", "frozen_set_type", "iterable_type", "deque_type"), "a list"
    ),
    **dict.fromkeys(
        ("model_type", "model_attributes_type", "dict_type", "mapping_type", "named_tuple_type"), "a mapping"
    ),
    **dict.fromkeys(("dataclass_type", "arguments_type", "frozen_dict_type", "ordered_dict_type"), "a mapping"),
    "counter_type": "a mapping of counts",
    "none_required": "nothing (null)",
    "callable_type": "a function",
    "is_instance_of": "an instance of {class}",
    "is_subclass_of": "a subclass of {class}",
    "string_unicode": "text without broken characters",
    "string_not_ascii": "plain ASCII text",
    "bytes_invalid_encoding": "bytes in the encoding {encoding}",
    **dict.fromkeys(
        ("date_type", "date_parsing", "date_from_datetime_parsing", "date_from_datetime_inexact"), "a date"
    ),
    "date_past": "a date in the past",
    "date_future": "a date in the future",
    **dict.fromkeys(("time_type", "time_parsing"), "a time of day"),
    **dict.fromkeys(
        ("datetime_type", "datetime_parsing", "datetime_object_invalid", "datetime_from_date_parsing"),
        "a date and time",
    ),
    "datetime_past": "a moment in the past",
    "datetime_future": "a moment in the future",
    "timezone_naive": "a time without a time zone",
    "timezone_aware": "a time with a time zone",
    "timezone_offset": "a time zone offset of {tz_expected}",
    **dict.fromkeys(("time_delta_type", "time_delta_parsing"), "a duration"),
    **dict.fromkeys(("url_type", "url_parsing", "url_syntax_violation"), "a URL"),
    "url_too_long": "a URL of at most {max_length} characters",
    "url_scheme": "a URL with one of the schemes {expected_schemes}",
    **dict.fromkeys(("uuid_type", "uuid_parsing"), "a UUID"),
    "uuid_version": "a UUID of version {expected_version}",
    **dict.fromkeys(("decimal_type", "decimal_parsing"), "a decimal number"),
    "decimal_max_digits": "a decimal number of at most {max_digits} digits",
    "decimal_max_places": "a decimal number of at most {decimal_places} decimal places",
    "decimal_whole_digits": "a decimal number of at most {whole_digits} digits before the point",
    **dict.fromkeys(("complex_type", "complex_str_parsing"), "a complex number"),
    **dict.fromkeys(("fraction_type", "fraction_parsing"), "a fraction"),
    **dict.fromkeys(("json_type", "json_invalid"), "text that holds JSON"),
    "union_tag_not_found": "a mapping with the key {discriminator}",
}
"""What a type of error says was expected; what was given follows."""

TYPE_ERRORS = frozenset(
    kind for kind in EXPECTED if kind.endswith(("_type", "_parsing")) or kind in ("int_from_float", "none_required")
)
"""Errors that say that a value is of another type; the annotation says better than pydantic what was expected."""

BOUNDS: Mapping[str, str] = {
    "greater_than": "must be greater than {gt}",
    "greater_than_equal": "must be at least {ge}",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be at most {le}",
    "multiple_of": "must be a multiple of {multiple_of}",
    "finite_number": "must be a finite number",
    "int_parsing_size": "is too large for a whole number",
    "string_too_short": "must have at least {min_length} characters",
    "string_too_long": "must have at most {max_length} characters",
    "bytes_too_short": "must have at least {min_length} bytes",
    "bytes_too_long": "must have at most {max_length} bytes",
}
"""Errors about a limit; what was given follows."""

MISSING = "this key is required but missing"

PYDANTIC_TYPES = frozenset(get_args(core_schema.ErrorType))


def sentence(kind: str, context: Mapping[str, Any], given: object, raw: str, expected: str = "") -> str:
    """The sentence of one error.

    Args:
        kind: pydantic's error type.
        context: the numbers and choices of the error.
        given: what was written.
        raw: pydantic's own words, used only for the types that a plugin has defined itself.
        expected: what the annotation asks for, in words; empty where that is unknown.
    """
    if kind in ("value_error", "assertion_error"):
        return str(context.get("error") or raw)
    if kind in TYPE_ERRORS:
        return f"expected {expected or EXPECTED[kind]}, got {describe(given)}{_quote_hint(kind, given)}"
    if kind in EXPECTED:
        return f"expected {EXPECTED[kind].format_map(_Blank(context))}, got {describe(given)}"
    if kind in BOUNDS:
        limits = {name: f"{limit:g}" if isinstance(limit, float) else limit for name, limit in context.items()}
        return f"{BOUNDS[kind].format_map(_Blank(limits))}, got {shown(given)}"
    if kind in ("literal_error", "enum", "union_tag_invalid"):
        return _choice(context, given)
    if kind in ("too_short", "too_long"):
        return _length(kind, context)
    if kind == "string_pattern_mismatch":
        pattern = str(context.get("pattern", ""))
        return f"{PATTERNS.get(pattern, f'must match the pattern {pattern}')}; got {shown(given)}"
    if kind in ("missing", "missing_argument", "missing_keyword_only_argument", "missing_positional_only_argument"):
        return MISSING
    if kind in ("extra_forbidden", "unexpected_keyword_argument", "unexpected_positional_argument"):
        return "unknown key"
    return raw if kind not in PYDANTIC_TYPES else f"this value cannot be used here, got {describe(given)}"


class _Blank(dict[str, Any]):
    """A context that shows nothing for what is not in it."""

    def __missing__(self, key: str) -> str:
        return "?"


def _choice(context: Mapping[str, Any], given: object) -> str:
    """Pydantic gives the choices as one text: `'a', 'b' or 3`."""
    listed = str(context.get("expected") or context.get("expected_tags") or "")
    choices = [text or other for text, other in re.findall(r"'((?:[^'\\]|\\.)*)'|([^\s,']+)", listed) if other != "or"]
    got = context.get("tag", given)
    hint = suggest(got, choices) if isinstance(got, str) else ""
    scalar = isinstance(got, str | int | float)
    return f"expected one of {', '.join(choices)}; got {shown(got) if scalar else describe(got)}{hint}"


def _length(kind: str, context: Mapping[str, Any]) -> str:
    limit = int(context.get("min_length" if kind == "too_short" else "max_length", 0))
    bound = "at least" if kind == "too_short" else "at most"
    return f"expected {bound} {count(limit, 'item')}, got {context.get('actual_length') or 'none'}"


def _quote_hint(kind: str, given: object) -> str:
    scalar = isinstance(given, int | float)
    return f"; write '{shown(given)}' in quotes if it is meant as text" if kind == "string_type" and scalar else ""


def describe(value: object) -> str:
    """A value with its type: `the text 'abc'`, `a list of 3 items`."""
    if value is None:
        return "nothing (null)"
    if isinstance(value, bool):
        return shown(value)
    if isinstance(value, str):
        return f"the text {shown(value)}"
    if isinstance(value, int | float):
        return f"the number {shown(value)}"
    if isinstance(value, Mapping):
        names: list[str] = [f"'{key}'" for key in value]  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]
        return (
            f"a mapping with the {'key' if len(names) == 1 else 'keys'} {listing(names)}"
            if names
            else "an empty mapping"
        )
    if isinstance(value, Sequence) and not isinstance(value, bytes):
        return f"a list of {count(len(value), 'item')}" if len(value) else "an empty list"  # pyright: ignore[reportUnknownArgumentType]
    return f"a {type(value).__name__}"


def shown(value: object) -> str:
    """A value as a file would write it, cut after 60 characters."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}…"


def count(number: int, noun: str) -> str:
    """`1 item`, `3 items`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def suggest(name: str, names: Sequence[str]) -> str:
    """`; did you mean 'x'?` for the nearest name, else an empty string."""
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    return f"; did you mean '{near[0]}'?" if near else ""


def listing(names: Sequence[str], limit: int = 20) -> str:
    """The names, cut after `limit`."""
    rest = f" and {len(names) - limit} more" if len(names) > limit else ""
    return (", ".join(names[:limit]) + rest) or "none"


def unknown_key(key: str, known: Sequence[str], elsewhere: Mapping[str, str]) -> str:
    """The sentence for a key that does not exist.

    Args:
        key: what was written.
        known: the keys that exist at the place.
        elsewhere: keys that exist one level further down, with their paths.
    """
    if key in elsewhere:
        return f"unknown key; it belongs further down: '{elsewhere[key]}'"
    near = suggest(key, known)
    if near:
        return f"unknown key{near}"
    return f"unknown key; the keys here are {listing(known)}" if known else "unknown key; no keys are expected here"
