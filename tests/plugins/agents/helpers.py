"""Workspaces of agents for tests, and calls of their tools."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import replace
from typing import Any, TypeVar

import pytest

from anysim.errors import AnysimError
from anysim_agents.answers import Answer
from anysim_agents.limits import AGENT, SERVICE, AgentLimits
from anysim_agents.tools import call
from anysim_agents.workspace import Workspace
from anysim_serving.catalogue import Catalogue
from anysim_serving.settings import Limits
from tests.task.helpers import BLOCKS

LONG: dict[str, Any] = BLOCKS | {"task": BLOCKS["task"] | {"horizon": 100_000, "on_success": "continue"}}
"""The blocks, in which time can pass for long."""
T = TypeVar("T")


def workspace(*sources: Any, limits: Limits = SERVICE, agent: AgentLimits = AGENT, shared: bool = False) -> Workspace:
    return Workspace(Catalogue.of(sources or (LONG,), limits=limits), agent, shared=shared)


class Caller:
    """Calls the tools of a workspace."""

    def __init__(self, space: Workspace) -> None:
        self.space = space

    async def answer(self, name: str, /, **arguments: Any) -> Answer:
        return await call(self.space, name, arguments)

    async def __call__(self, name: str, /, **arguments: Any) -> dict[str, Any]:
        return dict((await self.answer(name, **arguments)).data)

    async def refused(self, name: str, /, **arguments: Any) -> str:
        with pytest.raises(AnysimError) as caught:
            await call(self.space, name, arguments)
        return str(caught.value)


def used(scenario: Callable[[Caller], Awaitable[T]], *sources: Any, **options: Any) -> T:
    """A scenario in a workspace of its own, which is freed after it."""

    async def go() -> T:
        space = workspace(*sources, **options)
        try:
            return await scenario(Caller(space))
        finally:
            await space.close()

    return run(go())


def run(coroutine: Coroutine[Any, Any, T]) -> T:
    return asyncio.run(coroutine)


__all__ = ["AGENT", "BLOCKS", "LONG", "SERVICE", "Caller", "replace", "run", "used", "workspace"]
