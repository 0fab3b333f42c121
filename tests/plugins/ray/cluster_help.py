"""A Ray cluster of several nodes on this machine."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

STORE = 80 << 20
"""Bytes of the object store of a node; the least is 75 MB."""
PORTS = ("metrics_agent_port", "dashboard_agent_listen_port", "runtime_env_agent_port", "metrics_export_port")
QUICK = {"health_check_period_ms": 1000, "health_check_failure_threshold": 5, "health_check_timeout_ms": 4000}
"""A node that is gone is missed after seconds, and one of a busy machine is not taken for gone."""


def add(cluster: Any, cpus: int, **more: Any) -> Any:
    """A node; where the machine is so busy that it does not begin in time, another one."""
    for _ in range(4):
        ports = dict(zip(PORTS, free_ports(len(PORTS)), strict=True))
        with suppress(Exception):  # plain ones of Ray
            return cluster.add_node(num_cpus=cpus, object_store_memory=STORE, **ports, **more)
    pytest.fail("no node of Ray begins on this machine")


def free_ports(count: int) -> list[int]:
    """Ports that nothing listens on."""
    open_ = [socket.socket() for _ in range(count)]
    for one in open_:
        one.bind(("127.0.0.1", 0))
    found = [one.getsockname()[1] for one in open_]
    for one in open_:
        one.close()
    return found


@contextmanager
def cluster_of(nodes: int) -> Iterator[tuple[Any, list[Any]]]:
    """A head without room for work, and nodes with room for one worker each; this process is connected."""
    ray = pytest.importorskip("ray")
    from ray.cluster_utils import Cluster  # pyright: ignore[reportMissingImports]

    # a busy machine is given time to start Ray's agents
    os.environ |= {"RAY_USAGE_STATS_ENABLED": "0", "RAY_agent_register_timeout_ms": "300000"}
    cluster = Cluster()
    try:
        add(cluster, 0, include_dashboard=False, _system_config=QUICK)
        workers = [add(cluster, 1) for _ in range(nodes)]
        ray.init(address=cluster.address, log_to_driver=False)
        yield cluster, workers
    finally:
        ray.shutdown()
        cluster.shutdown()


def kill(cluster: Any, node: Any) -> None:
    """As when a machine loses its power: its raylet is gone, and its workers with it."""
    [raylet] = node.all_processes["raylet"]
    os.kill(raylet.process.pid, 9)
    cluster.worker_nodes.discard(node)  # else its end is waited for when the cluster is shut down
