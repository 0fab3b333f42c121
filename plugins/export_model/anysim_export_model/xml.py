"""Elements of XML with numbers that are read back as they are."""

from collections.abc import Iterable
from typing import Any

from lxml import etree


def number(value: float) -> str:
    """A number of which every digit counts."""
    return repr(float(value) + 0.0)


def numbers(values: Iterable[float]) -> str:
    """Numbers with spaces between them."""
    return " ".join(number(value) for value in values)


def sub(parent: Any, tag: str, **attributes: str | None) -> Any:
    """A child with the attributes that are given."""
    return etree.SubElement(parent, tag, {key: text for key, text in attributes.items() if text is not None})


def named(root: str, **attributes: str) -> Any:
    """A root element."""
    return etree.Element(root, attributes)


def document(root: Any) -> bytes:
    """The file of a root element."""
    etree.indent(root)
    return etree.tostring(root, xml_declaration=True, encoding="utf-8")
