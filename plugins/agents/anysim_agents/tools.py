"""Tools by name: one registry for the server, for definitions in other frameworks, and for calls from Python."""

import logging
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from anysim.errors import AnysimError, TaskError, listing, suggest
from anysim.plugin_parameters import checked
from anysim_agents.answers import Answer, shortened
from anysim_agents.arguments import Arguments
from anysim_agents.toolbox import acting, asking, authoring, catalog, looking, moments, sessions
from anysim_agents.workspace import Told, Workspace
from anysim_client.errors import to_data

_log = logging.getLogger(__name__)
Style = Literal["mcp", "openai", "anthropic"]


@dataclass(frozen=True)
class Tool:
    """A tool.

    Attributes:
        name: by which it is called.
        about: what it does, for the model that chooses among tools.
        arguments: the model of its arguments.
        run: does it, in a workspace with its arguments.
        reads: whether it changes nothing.
        tells: whether it takes what is told of progress as well.
    """

    name: str
    about: str
    arguments: type[Arguments]
    run: Callable[..., Awaitable[Answer]]
    reads: bool
    tells: bool

    def schema(self) -> dict[str, Any]:
        """The JSON schema of its arguments, without references."""
        whole = self.arguments.model_json_schema()
        return _inline(whole, whole.pop("$defs", {}))


def _inline(value: Any, definitions: Mapping[str, Any]) -> Any:
    """A schema with definitions in their places, and without titles, which only repeat the keys."""
    if isinstance(value, list):
        return [_inline(item, definitions) for item in value]
    if not isinstance(value, dict):
        return value
    if "$ref" in value:
        found = definitions[str(value["$ref"]).rpartition("/")[2]]
        return _inline({**found, **{k: v for k, v in value.items() if k != "$ref"}}, definitions)
    plain = {k: v for k, v in value.items() if not (k == "title" and isinstance(v, str))}
    return {k: _inline(v, definitions) for k, v in plain.items()}


def _tools() -> dict[str, Tool]:
    found: dict[str, Tool] = {}
    for module in (catalog, sessions, looking, acting, moments, asking, authoring):
        for function, arguments, reads in module.TOOLS:
            about = " ".join((function.__doc__ or "").split())
            found[function.__name__] = Tool(
                function.__name__, about, arguments, function, reads, function in acting.TELLS
            )
    return found


TOOLS: Mapping[str, Tool] = _tools()


def definitions(style: Style = "mcp") -> list[dict[str, Any]]:
    """The tools as JSON, in the form of MCP, of OpenAI's function tools, or of Anthropic's."""
    if style == "openai":
        return [
            {"type": "function", "function": {"name": t.name, "description": t.about, "parameters": t.schema()}}
            for t in TOOLS.values()
        ]
    key = "inputSchema" if style == "mcp" else "input_schema"
    return [
        {"name": t.name, "description": t.about, key: t.schema()}
        | ({"annotations": {"readOnlyHint": t.reads, "openWorldHint": False}} if style == "mcp" else {})
        for t in TOOLS.values()
    ]


async def call(
    workspace: Workspace, name: str, arguments: Mapping[str, Any] | None, told: Told | None = None
) -> Answer:
    """Call a tool by name.

    Args:
        workspace: where.
        name: of the tool.
        arguments: as its schema says.
        told: is told of progress.

    Raises:
        AnysimError: a sentence that says what was wrong, what there is, and what to do.
    """
    tool = TOOLS.get(name)
    if tool is None:
        raise TaskError(
            f"there is no tool '{name[:60]}'{suggest(name[:60], list(TOOLS))} (tools: {listing(TOOLS, 40)})"
        )
    given = checked(tool.arguments, dict(arguments or {}), name)
    answer = await (tool.run(workspace, given, told) if tool.tells else tool.run(workspace, given))
    return Answer(shortened(answer.data), answer.images)


def in_words(error: BaseException) -> str:
    """An error as its caller is told it. What is no error of anysim's is named only: its words may hold paths."""
    if not isinstance(error, AnysimError):
        _log.error("a tool failed", exc_info=error)
    return str(to_data(error)["message"])
