"""Server of the Model Context Protocol, on either major version of its SDK: the tools, over stdio or streamable HTTP.

The SDK's low-level server is used, so that the schemas are those of the registry and every error is one of its own
sentences. Images are image content.
"""

import asyncio
import base64
import json
import os
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from importlib.metadata import version
from typing import Any

from anysim import __version__
from anysim.errors import PluginError
from anysim_agents.answers import Answer
from anysim_agents.limits import AGENT, AgentLimits
from anysim_agents.tools import call, definitions, in_words
from anysim_agents.workspace import Told, Workspace
from anysim_serving.catalogue import Catalogue
from anysim_serving.settings import Settings

INSTRUCTIONS = (
    "Worlds of robots and things, simulated. Begin with list_catalog and create_session (or create_world with a YAML "
    "text of your own). observe, render and look_at tell what is where; run_skill and run_command have robots act, and "
    "answer with typed outcomes; nothing moves in between. An error says what to do: repair the call and try again. "
    "Lengths are in metres, angles in radians unless said otherwise, z is up."
)
HTTP_PATH = "/mcp"
MOST_CONNECTIONS = 64
"""Of MCP's own sessions at once."""


def sdk() -> Any:
    """The SDK.

    Raises:
        PluginError: it is not installed.
    """
    try:
        import mcp
    except ImportError as error:
        raise PluginError(
            f"the Model Context Protocol's SDK is not installed ({error}): pip install 'anysim-agents[mcp]'. The tools "
            f"do without it: `anysim mcp --definitions openai` prints them, `anysim_agents.tools.call` calls them"
        ) from None
    return mcp


def server(workspace: Workspace) -> Any:
    """A low-level server of the SDK that offers a workspace's tools."""
    sdk()
    if int(version("mcp").partition(".")[0]) >= 2:
        return _server_2(workspace)
    return _server_1(workspace)


def _server_2(workspace: Workspace) -> Any:
    from mcp.server.lowlevel import Server
    from mcp_types import CallToolResult, ListToolsResult, Tool

    tools = [Tool.model_validate(one) for one in definitions("mcp")]

    async def list_tools(context: Any, params: Any) -> Any:
        del context, params
        return ListToolsResult(tools=tools)

    async def call_tool(context: Any, params: Any) -> Any:
        async def told(steps: float, words: str) -> None:
            await context.session.report_progress(steps, None, words)

        content, data, failed = await _called(workspace, params.name, params.arguments, told)
        return CallToolResult.model_validate({"content": content, "structuredContent": data, "isError": failed})

    return Server(
        "anysim", version=__version__, instructions=INSTRUCTIONS, on_list_tools=list_tools, on_call_tool=call_tool
    )


def _server_1(workspace: Workspace) -> Any:
    from mcp import types
    from mcp.server.lowlevel import Server

    tools = [types.Tool.model_validate(one) for one in definitions("mcp")]
    made: Any = Server("anysim", version=__version__, instructions=INSTRUCTIONS)

    @made.list_tools()
    async def list_tools() -> Any:
        return tools

    @made.call_tool(validate_input=False)  # the tools' own sentences say what is wrong
    async def call_tool(name: str, arguments: Any) -> Any:
        context = made.request_context
        token = context.meta.progressToken if context.meta is not None else None

        async def told(steps: float, words: str) -> None:
            if token is not None:
                await context.session.send_progress_notification(
                    token, steps, None, words, related_request_id=str(context.request_id)
                )

        content, data, failed = await _called(workspace, name, arguments, told)
        return types.CallToolResult.model_validate({"content": content, "structuredContent": data, "isError": failed})

    return made


async def _called(
    workspace: Workspace, name: str, arguments: Any, told: Told
) -> tuple[list[dict[str, Any]], dict[str, Any] | None, bool]:
    """Content blocks, structured content, and whether it is an error."""
    try:
        answer = await call(workspace, name, arguments, told)
    except Exception as error:  # noqa: BLE001 - told to the agent, who can repair what it asked for
        return [{"type": "text", "text": in_words(error)}], None, True
    return _content(answer), dict(answer.data), False


def _content(answer: Answer) -> list[dict[str, Any]]:
    text = json.dumps(answer.data, ensure_ascii=False)
    images = [
        {"type": "image", "data": base64.b64encode(image).decode(), "mimeType": "image/png"} for image in answer.images
    ]
    return [{"type": "text", "text": text}, *images]


# ---------------------------------------------------------------------------------------------------------- transports


@asynccontextmanager
async def kept(workspace: Workspace) -> AsyncIterator[None]:
    """A workspace whose idle sessions are ended meanwhile, and all of them afterwards."""
    sweeper = asyncio.create_task(workspace.keep_clean())
    try:
        yield
    finally:
        sweeper.cancel()
        with suppress(asyncio.CancelledError):
            await sweeper
        await workspace.close()


async def serve_stdio(workspace: Workspace) -> None:
    """Serve the one client at the other end of stdin and stdout, until it closes them.

    Whatever else writes to the standard output, an engine's library too, writes to the standard error instead.
    """
    from mcp.server.stdio import stdio_server

    made = server(workspace)
    with _own_output() as streams:
        async with kept(workspace), stdio_server(*streams) as (reads, writes):
            await made.run(reads, writes, made.create_initialization_options())


@contextmanager
def _own_output() -> Iterator[tuple[Any, ...]]:
    """The wire's streams, apart from the descriptors of the process; version 2 of the SDK does that by itself."""
    if int(version("mcp").partition(".")[0]) >= 2:
        yield ()
        return
    import anyio

    wire = os.dup(1)
    os.dup2(2, 1)
    try:
        with os.fdopen(os.dup(0), encoding="utf-8", errors="replace") as reads:
            with os.fdopen(os.dup(wire), "w", encoding="utf-8") as writes:
                yield anyio.wrap_file(reads), anyio.wrap_file(writes)
    finally:
        os.dup2(wire, 1)
        os.close(wire)


def http_application(agents: AgentLimits = AGENT) -> Callable[[Catalogue, Settings], Any]:
    """What makes the application of `anysim_serving.server.Service`: streamable HTTP at HTTP_PATH, and nothing else.

    Who may ask is decided before it, by `anysim_serving.access.Gate`: token, Host, Origin, and sizes.
    """

    def make(catalogue: Catalogue, settings: Settings) -> Any:
        from mcp.server.streamable_http_manager import StreamableHTTPSessionManager
        from starlette.applications import Starlette
        from starlette.routing import Route

        workspace = Workspace(catalogue, agents)
        manager = StreamableHTTPSessionManager(
            server(workspace),
            session_idle_timeout=settings.limits.idle_s,
            max_request_body_size=settings.limits.body_bytes,
            max_sessions=MOST_CONNECTIONS,
        )

        class Endpoint:
            async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
                await manager.handle_request(scope, receive, send)

        @asynccontextmanager
        async def lifespan(app: Any) -> AsyncIterator[None]:
            del app
            async with kept(workspace), manager.run():
                yield

        app = Starlette(routes=[Route(HTTP_PATH, endpoint=Endpoint())], lifespan=lifespan)
        app.state.workspace = workspace
        app.state.sessions = workspace.sessions
        return app

    return make
