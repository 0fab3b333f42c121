"""The way to a Ray cluster, and what it has room for."""

import logging
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from anysim.errors import PluginError, TaskError

REACH_S = 5.0
"""How long a cluster's address may take to answer [s]."""
NO_STATISTICS = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
"""What a cluster that is started here is told: nothing is sent to Ray's makers, and GPUs stay as they are."""


def load_ray() -> Any:
    """The module `ray`.

    Raises:
        PluginError: it is not installed.
    """
    try:
        return import_module("ray")
    except ImportError as error:
        raise PluginError(
            f"--executor ray needs Ray, on this machine and on every node: pip install 'anysim-ray[ray]' ({error})"
        ) from None


@contextmanager
def connected(address: str) -> Iterator[Any]:
    """Ray, connected: to `address`, else to RAY_ADDRESS, else to the cluster of this machine, else to one made for it.

    A connection that is there already is used, and stays.

    Raises:
        PluginError: Ray is not installed.
        TaskError: nothing answers there, or it is no cluster that takes us.
    """
    ray = load_ray()
    if ray.is_initialized():
        yield ray
        return
    for name, value in NO_STATISTICS.items():
        os.environ.setdefault(name, value)
    asked = address or os.environ.get("RAY_ADDRESS", "")
    quiet = {"log_to_driver": False, "logging_level": logging.ERROR}
    if asked and asked not in ("auto", "local"):
        _refuse_unreachable(asked)
    try:
        if asked == "local":
            ray.init(address="local", include_dashboard=False, **quiet)
        elif asked:
            ray.init(address=asked, **quiet)
        else:
            try:
                ray.init(address="auto", **quiet)
            except ConnectionError:
                ray.init(address="local", include_dashboard=False, **quiet)
    except Exception as error:  # noqa: BLE001  Ray raises many kinds, and plain exceptions, of its own
        where = f"the Ray cluster at {asked}" if asked else "a Ray cluster on this machine"
        raise TaskError(
            f"cannot use {where}: {_first_line(error)}. `ray status --address {asked or 'auto'}` says whether it runs; "
            "this machine must be one of its nodes, with the Ray, the Python and the token that the others have"
        ) from None
    try:
        yield ray
    finally:
        ray.shutdown()


def _refuse_unreachable(address: str) -> None:
    if "://" in address:
        raise TaskError(
            f"--executor ray:address={address}: expected HOST:PORT of the head node, as in 10.0.0.1:6379; the command "
            "runs on a machine of the cluster, or as a job that is submitted to it"
        )
    host, colon, port = address.rpartition(":")
    try:
        if not colon or not port.isdigit():
            raise OSError("expected HOST:PORT, as in 10.0.0.1:6379")
        socket.create_connection((host.strip("[]"), int(port)), REACH_S).close()
    except (OSError, OverflowError) as error:
        raise TaskError(
            f"no Ray cluster answers at {address}: {error}. Start one (`ray start --head --port 6379`), or give its "
            "address as --executor ray:address=HOST:PORT or in RAY_ADDRESS"
        ) from None


def _first_line(error: BaseException) -> str:
    return next((line.strip() for line in str(error).splitlines() if line.strip()), type(error).__name__).rstrip(".")


def room(ray: Any, cpus: float, gpus: float) -> int:
    """How many workers the nodes that are alive have room for."""
    alive = [node["Resources"] for node in ray.nodes() if node["Alive"]]
    counts = (
        min(int(has.get(name, 0.0) // needs) for name, needs in (("CPU", cpus), ("GPU", gpus)) if needs > 0)
        for has in alive
    )
    return sum(counts)
