"""The server of the Model Context Protocol, asked by the protocol's own client: in memory, over stdio and over HTTP."""

import asyncio
import base64
import http.client
import io
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx2
import pytest
from mcp import Client
from mcp.client.stdio import StdioServerParameters
from mcp.client.streamable_http import streamable_http_client
from PIL import Image

from anysim_agents.cli.mcp import mcp
from anysim_agents.mcp_server import HTTP_PATH, http_application, server
from anysim_agents.tools import definitions
from anysim_serving.catalogue import Catalogue
from anysim_serving.server import Service, fresh_token
from anysim_serving.settings import Settings
from tests.plugins.agents.helpers import LONG, SERVICE, replace, run, workspace

Scenario = Callable[[Client], Awaitable[Any]]
FOREVER = {"skill": "watch", "parameters": {"steps": 90_000, "least": 90_000, "target": "red"}}


def in_memory(scenario: Scenario, *sources: Any) -> Any:
    """What a scenario gives, of a server in this process without any transport."""

    async def go() -> Any:
        space = workspace(*sources)
        try:
            async with Client(server(space)) as client:
                return await scenario(client)
        finally:
            await space.close()

    return run(go())


@asynccontextmanager
async def over_http(*sources: Any) -> AsyncIterator[tuple[Client, Service]]:
    """A client of a server on a port."""
    settings = Settings(token=fresh_token(), limits=replace(SERVICE, body_bytes=1 << 16))
    made = Service(Catalogue.of(sources, limits=settings.limits), settings, http_application())
    made.start()
    try:
        headers = {"Authorization": f"Bearer {settings.token}"}
        async with httpx2.AsyncClient(headers=headers, timeout=300) as link:
            async with Client(streamable_http_client(made.address + HTTP_PATH, http_client=link)) as client:
                yield client, made
    finally:
        await asyncio.to_thread(made.stop)


async def told(client: Client, name: str, /, **arguments: Any) -> dict[str, Any]:
    """What a tool answers, twice: as structured data, and as text."""
    result = await client.call_tool(name, arguments)
    assert not result.is_error, result.content
    assert json.loads(result.content[0].text) == result.structured_content
    return result.structured_content


async def image(client: Client, name: str, /, **arguments: Any) -> Image.Image:
    """The image that a tool answers with."""
    result = await client.call_tool(name, arguments)
    assert [part.type for part in result.content] == ["text", "image"]
    assert result.content[1].mime_type == "image/png"
    return Image.open(io.BytesIO(base64.b64decode(result.content[1].data)))


# ------------------------------------------------------------------ in memory


def test_the_server_lists_the_definitions_and_answers_with_data_and_errors() -> None:
    async def scenario(client: Client) -> None:
        listed = (await client.list_tools()).tools
        plain = [tool.model_dump(by_alias=True, exclude_none=True, mode="json") for tool in listed]
        assert plain == definitions("mcp")
        session = (await told(client, "create_session", seed=1))["session"]
        ticks: list[tuple[float, str]] = []

        async def progress(steps: float, total: float | None, words: str | None) -> None:
            del total
            ticks.append((steps, words or ""))

        arguments = {"session": session, "skill": "watch", "parameters": {"steps": 1200, "least": 1200}}
        result = await client.call_tool("run_skill", arguments, progress_callback=progress)
        assert result.structured_content["ok"] is True
        assert [steps for steps, _ in ticks] == sorted(steps for steps, _ in ticks)
        assert ticks[-1][0] == result.structured_content["envs"][0]["steps"]
        assert any("1 watch" in words for _, words in ticks[:-1])
        wrong = await client.call_tool("observe", {"session": session, "enf": 0})
        assert wrong.is_error
        assert wrong.content[0].text == "observe.enf: unknown key; did you mean 'env'?"
        assert (await client.call_tool("observ", {})).is_error
        scene = await told(client, "ask", session=session)
        assert "ball" in scene["scene"]
        await told(client, "end_session", session=session)

    in_memory(scenario)


def test_a_call_that_its_client_cancels_gives_its_commands_up() -> None:
    async def scenario(client: Client) -> None:
        session = (await told(client, "create_session"))["session"]
        call = asyncio.create_task(client.call_tool("run_skill", {"session": session, **FOREVER}))
        while not (await told(client, "status", session=session)).get("commands", {}).get("progress"):
            await asyncio.sleep(0.01)
        call.cancel()
        await asyncio.gather(call, return_exceptions=True)
        while not (await told(client, "status", session=session))["commands"]["done"]:
            await asyncio.sleep(0.01)
        ended = (await told(client, "status", session=session))["commands"]["envs"][0]
        assert ended["outcome"] == "cancelled"

    in_memory(scenario)


# ------------------------------------------------------------------ who may ask


def test_over_http_only_who_has_the_token_is_answered_and_sessions_are_not_shown() -> None:
    def status(made: Service, **headers: str) -> int:
        named = {"Authorization": f"Bearer {made.settings.token}", "Content-Type": "application/json"}
        named |= {"Accept": "application/json, text/event-stream"}
        named |= {key.replace("_", "-"): value for key, value in headers.items()}
        body = named.pop("body", '{"jsonrpc": "2.0", "id": 1, "method": "ping"}')
        link = http.client.HTTPConnection("127.0.0.1", made.settings.port, timeout=30)
        link.request("POST", named.pop("path", HTTP_PATH), body, named)
        answer = link.getresponse()
        answer.read()
        link.close()
        return answer.status

    async def go() -> None:
        async with over_http(LONG) as (client, made):
            session = (await told(client, "create_session"))["session"]
            assert len(session) > 16
            assert (await told(client, "status"))["sessions"] == []
            assert (await told(client, "observe", session=session))["env"] == 0
            refused = {
                401: [{"Authorization": "Bearer wrong"}, {"Authorization": ""}],
                403: [{"Host": "evil.example"}, {"Origin": "https://evil.example"}, {"Origin": "http://127.0.0.1"}],
                404: [{"path": "/v1/sessions"}, {"path": "/"}, {"path": HTTP_PATH + "/x"}],
                413: [{"body": '"' + "x" * (1 << 16) + '"'}],
            }
            for code, requests in refused.items():
                for headers in requests:
                    assert await asyncio.to_thread(status, made, **headers) == code, headers
            assert (await told(client, "observe", session=session))["env"] == 0

    run(go())


# ------------------------------------------------------------------ a task in ten steps


async def ten_steps(client: Client) -> dict[str, Any]:
    """A task that takes a drawer, a cube and the drawer again: what an agent does, and how it then is."""
    assert (await told(client, "list_catalog", kind="commands", contains="place"))["found"] >= 2
    made = await told(client, "create_session", task="put_away", seed=1, on_success="continue")
    session = made["session"]
    seen = await told(client, "observe", session=session)
    assert seen["success"]["inside"] is False
    assert "cabinet.drawer_1" in seen["things"]["cabinet"]["joints"]
    assert (
        await image(client, "look_at", session=session, target="cabinet.drawer_1.handle", width=64, height=48)
    ).size == (64, 48)
    drawer = {"part": "cabinet.drawer_1", "fraction": 0.85}
    assert (await told(client, "run_skill", session=session, skill="open", parameters=drawer, timeout=20))["ok"]
    kept = (await told(client, "snapshot", session=session))["snapshot"]
    wrong = await client.call_tool("run_skill", {"session": session, "skill": "grasp", "parameters": {"object": "cub"}})
    assert wrong.is_error
    assert "did you mean 'cube'?" in wrong.content[0].text
    assert (await told(client, "run_skill", session=session, skill="grasp", parameters={"object": "cube"}))["ok"]
    place = {"do": "place", "object": "cube", "target": "cabinet.drawer_1.inside", "tolerance": 0.09}
    shut = {"do": "close", "part": "cabinet.drawer_1"}
    assert (await told(client, "run_command", session=session, commands=[place, shut]))["ok"]
    await told(client, "wait", session=session, seconds=0.5)
    done = await told(client, "observe", session=session)
    assert set(done["success"].values()) == {True}
    words = await told(client, "ask", session=session, about="story")
    assert any("drawer" in one["text"] for one in words["story"])
    await told(client, "reset_to", session=session, snapshot=kept)
    assert (await told(client, "observe", session=session))["success"]["inside"] is False
    await told(client, "end_session", session=session)
    return done


@pytest.mark.slow
def test_an_agent_does_a_task_in_ten_steps_over_both_transports(tmp_path: Path) -> None:
    async def stdio() -> dict[str, Any]:
        arguments = ["-m", "anysim.cli", "mcp", "put_away"]
        command = StdioServerParameters(command=sys.executable, args=arguments, env=dict(os.environ), cwd=tmp_path)
        async with Client(command) as client:
            return await ten_steps(client)

    async def http() -> dict[str, Any]:
        async with over_http("put_away") as (client, _):
            return await ten_steps(client)

    assert run(stdio()) == run(http())
    assert list(tmp_path.iterdir()) == []


def test_the_command_prints_the_definitions(capsys: pytest.CaptureFixture[str]) -> None:
    mcp(definitions="openai")
    assert json.loads(capsys.readouterr().out) == definitions("openai")


@pytest.mark.slow
def test_the_command_listens_with_a_token_and_ends(tmp_path: Path) -> None:
    world = tmp_path / "blocks.yaml"
    world.write_text(json.dumps(LONG))
    environment = os.environ | {"ANYSIM_STATE_DIR": str(tmp_path / "state"), "PYTHONUNBUFFERED": "1"}
    environment.pop("ANYSIM_SERVE_TOKEN", None)
    command = [sys.executable, "-m", "anysim.cli", "mcp", str(world), "--http", "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
    assert process.stdout is not None
    try:
        lines = [process.stdout.readline() for _ in range(4)]
        address = re.search(r"http://127\.0\.0\.1:\d+/mcp", lines[0])
        token = re.search(r"token: (\S{43})\n", lines[1])
        assert address is not None, lines
        assert token is not None, lines
        [kept] = (tmp_path / "state" / "services").iterdir()
        assert kept.stat().st_mode & 0o777 == 0o600

        async def go() -> None:
            headers = {"Authorization": f"Bearer {token.group(1)}"}
            async with httpx2.AsyncClient(headers=headers, timeout=60) as link:
                async with Client(streamable_http_client(address.group(), http_client=link)) as client:
                    session = (await told(client, "create_session"))["session"]
                    await told(client, "run_skill", session=session, wait=0, **FOREVER)

        run(go())
        process.send_signal(signal.SIGTERM)  # with commands under way
        rest = process.stdout.read()
        assert process.wait(60) == 0, rest
        assert rest == "ended: all envs are freed\n"
        assert not kept.exists()
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
