"""The executor `ray` where Ray is not installed, and its parts that need none."""

import os
import pickle  # noqa: TID251  as Ray with what it carries
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from anysim.errors import PluginError, SpecError, TaskError
from anysim_processes.executors import job_executor
from anysim_ray import cluster, node
from anysim_ray.node import Worker


@contextmanager
def halving() -> Iterator[Callable[[int], int]]:
    def halve(number: int) -> int:
        if number % 2:
            raise TaskError(f"{number} is odd")
        return number // 2 if number else 1 // number

    yield halve


def missing(name: str) -> object:
    raise ImportError(f"No module named '{name}'")


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "import_module", missing)
    with pytest.raises(PluginError, match=r"pip install 'anysim-ray\[ray\]'"):
        list(job_executor("ray").treat_all([(1,)], halving))


def test_options_are_checked() -> None:
    for text, key in (("ray:num_cpus=0", "num_cpus"), ("ray:tries=0", "tries"), ("ray:cpus=1", "cpus")):
        with pytest.raises(SpecError, match=rf"executor.{key}"):
            job_executor(text)


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("ray://10.0.0.1:10001", "expected HOST:PORT of the head node"),
        ("127.0.0.1:9", "no Ray cluster answers at 127.0.0.1:9"),
        ("head", "expected HOST:PORT"),
        ("head:many", "expected HOST:PORT"),
        ("127.0.0.1:99999", "no Ray cluster answers"),
    ],
)
def test_an_address_that_cannot_be_one(address: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "import_module", lambda name: SimpleNamespace(is_initialized=lambda: False))
    with pytest.raises(TaskError, match=said), cluster.connected(address):
        pass


def test_what_a_worker_says_of_an_item(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(node.tempfile, "gettempdir", lambda: str(tmp_path))
    worker = Worker(pickle.dumps(halving), 0, "/nowhere/at/all", [])
    place = worker.place()
    assert place.folder == ""
    assert place.packages["anysim-ray"] == node.packages()["anysim-ray"]
    assert worker.treat(pickle.dumps((4,))) == (node.DONE, 2)
    assert worker.treat(pickle.dumps((3,))) == (node.REFUSED, "3 is odd")
    kind, words = worker.treat(pickle.dumps((0,)))
    assert kind == node.BROKE
    assert "ZeroDivisionError" in words
    worker.close()
    away = pickle.dumps(halving).replace(__name__.encode(), b"tests.plugins.ray.not_there".ljust(len(__name__), b"_"))
    assert Worker(away, 0, "", []).treat(pickle.dumps((4,)))[0] == node.LACKING


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system does not keep processes to cores")
def test_workers_of_a_node_keep_to_cores_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept: list[set[int]] = []
    monkeypatch.setattr(node.tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {4, 5, 7})
    monkeypatch.setattr(os, "sched_setaffinity", lambda pid, cores: kept.append(set(cores)))
    held = [node.keep_to(2), node.keep_to(1)]
    assert kept == [{4, 5}, {7}]
    assert node.keep_to(1) == []
    for one in held[1]:
        os.close(one)
    held[1] = node.keep_to(1)
    assert kept == [{4, 5}, {7}, {7}]
    for one in (*held[0], *held[1]):
        os.close(one)


def test_nodes_have_room_for_so_many_workers() -> None:
    nodes = [
        {"Alive": True, "Resources": {"CPU": 8.0, "GPU": 1.0}},
        {"Alive": True, "Resources": {"CPU": 3.0}},
        {"Alive": False, "Resources": {"CPU": 64.0}},
    ]
    ray = SimpleNamespace(nodes=lambda: nodes)
    assert cluster.room(ray, 2.0, 0.0) == 5
    assert cluster.room(ray, 0.5, 0.0) == 22
    assert cluster.room(ray, 1.0, 0.5) == 2
