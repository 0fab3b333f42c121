"""Safe YAML to plain data in which every key and value knows its file, line and column.

The scalars are those of YAML 1.2: only `true` and `false` are booleans, so the key `on:` stays the text "on"; `1e-3` is
a number; `014` is fourteen; there are no dates. Keys are always text. A key that is given twice, a tag that would
construct an object, and aliases that expand without bound are faults.
"""

import math
import re
from typing import Any, NamedTuple, cast

import yaml

from anysim_schemas.limits import YAML_ALIASED, YAML_DEPTH, YAML_VALUES
from anysim_schemas.nodes import Fault, Mark, Node, Scalar

_READ_TWICE = 1 << 16
"""Characters of a text that is read again in Python for the sake of its error; longer ones would take seconds."""

TAG = "tag:yaml.org,2002:"
_PATTERNS = {
    "null": (r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    "bool": (r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    "int": (r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", list("-+0123456789")),
    "float": (
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        list("-+0123456789."),
    ),
    "merge": (r"<<", ["<"]),
}
_REGEXES = {kind: re.compile(rf"(?:{pattern})\Z") for kind, (pattern, _) in _PATTERNS.items()}


class _Loader(yaml.SafeLoader):
    """Composes nodes with the scalar types of YAML 1.2 instead of 1.1."""


_C_LOADER: type | None = getattr(yaml, "CSafeLoader", None)
"""PyYAML over libyaml, about twenty times as fast, where it was built with it."""

_FastLoader = type("_FastLoader", (_C_LOADER or yaml.SafeLoader,), {})

for _loader in (_Loader, _FastLoader):
    cast("Any", _loader).yaml_implicit_resolvers = {}
    for _kind, (_, _first) in _PATTERNS.items():
        cast("Any", _loader).add_implicit_resolver(TAG + _kind, _REGEXES[_kind], _first)


def _compose(text: str) -> yaml.Node | None:
    """The nodes of a text. What libyaml refuses is read again in Python, so that errors are the same everywhere."""
    compose = cast("Any", yaml).compose
    if _C_LOADER is not None:
        try:
            _check_budget(text, _FastLoader)
            return compose(text, Loader=_FastLoader)
        except (yaml.YAMLError, ValueError):
            if len(text) > _READ_TWICE:
                raise
    _check_budget(text, _Loader)
    return compose(text, Loader=_Loader)


def _check_budget(text: str, loader: type) -> None:
    """Refuses what would overflow libyaml's stack, or the memory; the stream of events needs neither."""
    depth = values = 0
    for event in cast("Any", yaml).parse(text, Loader=loader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        values += isinstance(event, yaml.NodeEvent)
        if YAML_DEPTH.exceeded(depth):
            raise RecursionError
        if YAML_VALUES.exceeded(values):
            raise _TooLargeError


class _TooLargeError(Exception):
    """A text with more values than are read."""


class _Fatal(Exception):
    """Carries the fault after which a file cannot be read on."""

    def __init__(self, fault: Fault) -> None:
        super().__init__(fault.message)
        self.fault = fault


def parse(text: str, source: str, faults: list[Fault]) -> Node | None:
    """The data of a YAML text; None where it cannot be read. What is wrong is appended to `faults`.

    Args:
        text: one YAML document; an empty one is an empty mapping.
        source: the name that places begin with.
        faults: receives a fault for each duplicate key, refused tag and syntax error.
    """
    try:
        root = _compose(text)
        return _Builder(source, faults).build(root) if root is not None else Node({}, Mark(source, 1, 1))
    except yaml.MarkedYAMLError as error:
        faults.append(_syntax_fault(error, source))
    except yaml.reader.ReaderError as error:
        if not 0 <= error.position < len(text):  # libyaml's count is in bytes
            faults.append(Fault(Mark(source, 1, 1), "", f"not valid YAML: {error.reason}"))
            return None
        before = text[: error.position]
        character = ord(text[error.position])
        mark = Mark(source, before.count("\n") + 1, error.position - (before.rfind("\n") + 1) + 1)
        faults.append(Fault(mark, "", f"the character U+{character:04X} is not allowed in YAML"))
    except ValueError as error:  # an escape beyond Unicode, such as "\U00110000"
        faults.append(Fault(Mark(source, 1, 1), "", f"not valid YAML: {error}"))
    except RecursionError:
        faults.append(Fault(Mark(source, 1, 1), "", f"the file {YAML_DEPTH.sentence()}"))
    except _TooLargeError:
        faults.append(Fault(Mark(source, 1, 1), "", f"the file {YAML_VALUES.sentence()}"))
    except _Fatal as error:
        faults.append(error.fault)
    return None


class _BuiltNode(NamedTuple):
    """Data, how many values it holds with all aliases expanded, and how deep it goes."""

    node: Node
    size: int
    depth: int


class _Builder:
    """Turns composed nodes into ours, counting what aliases repeat."""

    def __init__(self, source: str, faults: list[Fault]) -> None:
        self._source = source
        self._faults = faults
        self._done: dict[int, _BuiltNode] = {}
        self._open: set[int] = set()
        self._aliased = 0

    def build(self, node: yaml.Node) -> Node:
        """The data below a node."""
        return self._build(node).node

    def _mark(self, node: yaml.Node) -> Mark:
        return _mark(node.start_mark, self._source)

    def _fault(self, node: yaml.Node, message: str) -> None:
        self._faults.append(Fault(self._mark(node), "", message))

    def _build(self, node: yaml.Node) -> _BuiltNode:
        identity = id(node)
        if identity in self._open:
            raise _Fatal(Fault(self._mark(node), "", "the value of this anchor contains itself"))
        if identity in self._done:
            return self._alias(node, self._done[identity])
        self._open.add(identity)
        if isinstance(node, yaml.MappingNode):
            built = self._mapping(node)
        elif isinstance(node, yaml.SequenceNode):
            built = self._sequence(node)
        else:
            built = _BuiltNode(Node(self._scalar(cast("yaml.ScalarNode", node)), self._mark(node)), 1, 0)
        if max(built.depth, len(self._open)) > YAML_DEPTH.value:
            raise RecursionError
        self._check_tag(node)
        self._open.discard(identity)
        self._done[identity] = built
        return built

    def _alias(self, node: yaml.Node, built: _BuiltNode) -> _BuiltNode:
        self._aliased += built.size
        if YAML_ALIASED.exceeded(self._aliased):
            raise _Fatal(Fault(self._mark(node), "", f"the file {YAML_ALIASED.sentence()}"))
        return built

    def _sequence(self, node: yaml.SequenceNode) -> _BuiltNode:
        items = [self._build(item) for item in cast("list[yaml.Node]", node.value)]
        size, depth = sum(item.size for item in items), max((item.depth for item in items), default=0)
        return _BuiltNode(Node([item.node for item in items], self._mark(node)), 1 + size, 1 + depth)

    def _mapping(self, node: yaml.MappingNode) -> _BuiltNode:
        entries: dict[str, Node] = {}
        merged: dict[str, Node] = {}
        parts: list[_BuiltNode] = []
        for key, value in cast("list[tuple[yaml.Node, yaml.Node]]", node.value):
            if key.tag == TAG + "merge":
                parts += self._merge(value, merged)
                continue
            name = self._key(key)
            parts.append(self._build(value))
            if name is None:
                continue
            if name in entries:
                first = entries[name].key
                self._fault(key, f"the key '{name}' is given twice in one mapping; the first is at {first}")
                continue
            place = self._mark(key)
            empty = value.start_mark.index == value.end_mark.index
            entries[name] = Node(parts[-1].node.value, place, place) if empty else parts[-1].node.under(place)
        both = {**{name: child for name, child in merged.items() if name not in entries}, **entries}
        size, depth = sum(part.size for part in parts), max((part.depth for part in parts), default=0)
        return _BuiltNode(Node(both, self._mark(node)), 1 + size, 1 + depth)

    def _merge(self, value: yaml.Node, into: dict[str, Node]) -> list[_BuiltNode]:
        """The mappings that `<<` brings in; their entries go `into`, of several the first wins."""
        sources = cast("list[yaml.Node]", value.value) if isinstance(value, yaml.SequenceNode) else [value]
        parts = [self._build(source) for source in sources]
        for source, part in zip(sources, parts, strict=True):
            if isinstance(part.node.value, dict):
                for name, child in part.node.value.items():
                    into.setdefault(name, child)
            else:
                self._fault(source, "`<<` merges a mapping or a list of mappings, such as `<<: *anchor`")
        return parts

    def _key(self, key: yaml.Node) -> str | None:
        if not isinstance(key, yaml.ScalarNode):
            self._fault(key, "a key must be text, not a list or a mapping")
            return None
        if key.value == "" and key.tag == TAG + "null":
            self._fault(key, "a key is missing before the ':'")
            return None
        self._check_tag(key)
        return cast("str", key.value)

    def _check_tag(self, node: yaml.Node) -> None:
        allowed = (
            {"map"} if isinstance(node, yaml.MappingNode) else {"seq"} if isinstance(node, yaml.SequenceNode) else None
        )
        kind = node.tag.removeprefix(TAG) if node.tag.startswith(TAG) else ""
        if kind not in (allowed or {"str", "merge", *_PATTERNS}):
            shown = f"!!{kind}" if kind else node.tag
            self._fault(
                node, f"the tag {shown} is refused: a spec is plain data and constructs no objects; remove the tag"
            )

    def _scalar(self, node: yaml.ScalarNode) -> Scalar:
        text = cast("str", node.value)
        kind = node.tag.removeprefix(TAG)
        if kind not in _REGEXES or kind == "merge":
            return text
        if not _REGEXES[kind].match(text) and not (kind == "float" and _REGEXES["int"].match(text)):
            self._fault(node, f"the tag !!{kind} does not fit the text '{text}'")
            return text
        if kind == "null":
            return None
        if kind == "bool":
            return text.lower() == "true"
        if kind == "float":
            return _float(text)
        if len(text) > 300:
            self._fault(node, f"a whole number of {len(text)} digits is too long")
            return 0
        return int(text, 0) if text[:2] in ("0o", "0x") else int(text)


def _float(text: str) -> float:
    """A number as YAML writes it: with `.inf` and `.nan`."""
    special = text.lower().lstrip("+-")
    if special == ".inf":
        return -math.inf if text.startswith("-") else math.inf
    return math.nan if special == ".nan" else float(text)


def _mark(mark: yaml.Mark, source: str) -> Mark:
    return Mark(source, mark.line + 1, mark.column + 1)


_SYNTAX: tuple[tuple[str, str], ...] = (
    (r"found character '\\t'", "a tab cannot indent; use spaces"),
    (r"found character '(.+)' that cannot start", "a plain text cannot start with '{0}'; put the text in quotes"),
    (
        r"mapping values are not allowed",
        "a ':' is not expected here; either the line is indented wrongly, or the text needs quotes",
    ),
    (r"could not find expected ':'", "expected a ':' after the key that starts at {context}"),
    (r"expected ',' or '(.)'", "expected ',' or '{0}': the bracket that is opened at {context} is not closed"),
    (r"expected <block end>", "this line does not fit the block that starts at {context}; check the indentation"),
    (r"found unexpected end of stream", "the quote that is opened at {context} is not closed"),
    (r"found undefined alias '(.+)'", "the alias *{0} has no anchor &{0} before it"),
    (r"found duplicate anchor", "the anchor is defined twice; the first is at {context}"),
    (r"while parsing a flow node", "a key or a value is missing here"),
    (r"expected a single document", "a spec is one document, but a second one starts here with '---'"),
    (
        r"found undefined tag handle",
        "the tag is refused: a spec is plain data and constructs no objects; remove the tag",
    ),
    (r"found unknown escape character '(.+)'", "\\{0} is no escape; write \\\\ for a backslash, or use single quotes"),
)
"""What PyYAML says, and what we say instead; `{0}` is the first group, `{context}` where the construct began."""


def _syntax_fault(error: yaml.MarkedYAMLError, source: str) -> Fault:
    problem = f"{error.problem or ''} ({error.context})" if error.context else f"{error.problem or ''}"
    where = error.problem_mark or error.context_mark
    mark = _mark(where, source) if where is not None else Mark(source, 1, 1)
    began = error.context_mark
    context = f"line {began.line + 1}, column {began.column + 1}" if began is not None else "the start"
    for pattern, sentence in _SYNTAX:
        found = re.search(pattern, problem)
        if found:
            return Fault(mark, "", "not valid YAML: " + sentence.format(*found.groups(), context=context))
    return Fault(mark, "", f"not valid YAML: {problem}")
