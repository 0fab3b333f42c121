"""`anysim.connect`: the env of a service, or of several as one."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from anysim.errors import TaskError
from anysim_client.env import RemoteEnv
from anysim_client.link import Address, Link

if TYPE_CHECKING:
    from anysim_client.pool import PooledEnv


def connect(
    address: str | Sequence[str],
    *,
    task: str | None = None,
    num_envs: int | None = None,
    engine: str | None = None,
    robot: str | None = None,
    seed: int | None = None,
    overrides: Sequence[str] = (),
    curriculum: bool = False,
    token: str | None = None,
    ca: str | Path | None = None,
    timeout: float = 660.0,
    images: str = "auto",
    quality: int = 90,
    full: bool = False,
) -> "RemoteEnv | PooledEnv":
    """The env of a session that is created for it, and ended when it is closed.

    Args:
        address: `http://HOST:PORT` or `https://…`; of several the envs are one batch (`anysim_client.pool`).
        task: one of those that the service has; by default its first.
        num_envs, engine, robot, seed, curriculum: as of `anysim.make`, within what the service allows; `num_envs` are
            those of each service.
        overrides: as on the command line; a client may set what `GET /v1/catalogue` lists.
        token: by default that of ANYSIM_SERVE_TOKEN, or the one that a service of this user keeps on this machine.
        ca: a PEM file of who signs the service's certificate.
        timeout: seconds after which an answer that has not come is taken for lost.
        images: `raw`, `jpeg` of a `quality` (smaller, and no longer the same bits), `shared` in memory on the same
            machine, or `auto`: shared where it can be, else raw.
        full: whether `env.latest` has after each step what `env.details()` tells.

    Raises:
        AnysimError: the service refuses, or nothing answers.
    """
    request: dict[str, Any] = {
        "task": task,
        "num_envs": num_envs,
        "engine": engine,
        "robot": robot,
        "seed": seed,
        "curriculum": curriculum,
        "overrides": list(overrides),
    }
    if not isinstance(address, str):
        from anysim_client.pool import PooledEnv

        if images == "jpeg" or full:
            raise TaskError(
                "a pool has images as they are, and no details; connect to its services one by one for more"
            )
        return PooledEnv([Address(one, token, ca, timeout) for one in address], request, images)
    link = Link(Address(address, token, ca, timeout), request)
    try:
        return RemoteEnv(link, images, quality, full)
    except BaseException:
        link.close()
        raise
