"""The server with version 1 of the protocol's SDK, asked by that version's client (`make test-mcp-old`)."""

import asyncio
import base64
import io
import json
import os
import sys
from collections.abc import Awaitable, Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import httpx
import pytest
from PIL import Image

from anysim_agents.mcp_server import HTTP_PATH, http_application, server
from anysim_agents.tools import definitions
from anysim_serving.catalogue import Catalogue
from anysim_serving.server import Service, fresh_token
from anysim_serving.settings import Settings
from tests.plugins.agents.helpers import LONG, SERVICE, run, workspace

if int(version("mcp").partition(".")[0]) >= 2:
    pytest.skip("version 2 of mcp is installed: test_mcp.py asks it", allow_module_level=True)

from mcp import ClientSession, StdioServerParameters
from mcp.client.stdio import stdio_client
from mcp.client.streamable_http import streamable_http_client
from mcp.shared.memory import create_connected_server_and_client_session

Scenario = Callable[[ClientSession], Awaitable[None]]


async def told(client: ClientSession, name: str, /, **arguments: Any) -> dict[str, Any]:
    """What a tool answers, twice: as structured data, and as text."""
    result = await client.call_tool(name, arguments)
    assert not result.isError, result.content
    assert json.loads(result.content[0].text) == result.structuredContent
    return result.structuredContent


async def scenario(client: ClientSession) -> None:
    """What a session is for: it lists, commands with progress, draws, and tells what is wrong."""
    listed = (await client.list_tools()).tools
    plain = [tool.model_dump(by_alias=True, exclude_none=True, mode="json") for tool in listed]
    assert plain == definitions("mcp")
    session = (await told(client, "create_session", seed=1, engine="mujoco"))["session"]
    ticks: list[float] = []

    async def progress(steps: float, total: float | None, words: str | None) -> None:
        del total, words
        ticks.append(steps)

    skill = {"skill": "watch", "parameters": {"steps": 1200, "least": 1200, "target": "red"}}
    done = await client.call_tool("run_skill", {"session": session, **skill}, progress_callback=progress)
    assert done.structuredContent["ok"] is True
    assert ticks == sorted(ticks)
    assert len(ticks) > 1
    seen = await client.call_tool("look_at", {"session": session, "target": "red", "width": 32, "height": 24})
    assert [part.type for part in seen.content] == ["text", "image"]
    assert Image.open(io.BytesIO(base64.b64decode(seen.content[1].data))).size == (32, 24)
    wrong = await client.call_tool("observe", {"session": session, "enf": 0})
    assert wrong.isError
    assert wrong.content[0].text == "observe.enf: unknown key; did you mean 'env'?"
    await told(client, "end_session", session=session)


def test_in_memory() -> None:
    async def go() -> None:
        space = workspace()
        try:
            async with create_connected_server_and_client_session(server(space)) as client:
                await scenario(client)
        finally:
            await space.close()

    run(go())


def test_over_stdio(tmp_path: Path) -> None:
    world = tmp_path / "blocks.yaml"
    world.write_text(json.dumps(LONG))
    arguments = ["-m", "anysim.cli", "mcp", str(world)]

    async def go() -> None:
        command = StdioServerParameters(command=sys.executable, args=arguments, env=dict(os.environ), cwd=tmp_path)
        async with stdio_client(command) as streams, ClientSession(*streams) as client:
            await client.initialize()
            await scenario(client)

    run(go())


def test_over_http() -> None:
    async def go() -> None:
        settings = Settings(token=fresh_token(), limits=SERVICE)
        made = Service(Catalogue.of([LONG], limits=settings.limits), settings, http_application())
        made.start()
        try:
            headers = {"Authorization": f"Bearer {settings.token}"}
            async with httpx.AsyncClient(headers=headers, timeout=300) as link:
                async with streamable_http_client(made.address + HTTP_PATH, http_client=link) as streams:
                    async with ClientSession(*streams[:2]) as client:
                        await client.initialize()
                        await scenario(client)
        finally:
            await asyncio.to_thread(made.stop)

    run(go())
