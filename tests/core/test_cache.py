"""The cache may be lost, damaged, shared or full: results never depend on it."""

import logging
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from anysim import cache

KEY = "ab" * 32


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(cache.CACHE_ENV, str(tmp_path / "cache"))
    return tmp_path / "cache"


def _refuse() -> dict[str, np.ndarray]:
    raise AssertionError("it is cached")


def _make() -> dict[str, np.ndarray]:
    return {"v": np.arange(6.0).reshape(2, 3) / 3, "f": np.array([[0, 1, 1]], dtype=np.int32)}


def test_a_second_call_reads_the_same_bits(folder: Path) -> None:
    first = cache.load_or_make("kind", KEY, _make)
    second = cache.load_or_make("kind", KEY, _refuse)
    assert sorted(second) == ["f", "v"]
    for name, array in first.items():
        assert array.dtype == second[name].dtype
        np.testing.assert_array_equal(array, second[name])
    assert [p.suffix for p in folder.rglob("*") if p.is_file()] == [".npz"]


@pytest.mark.parametrize("damage", ["truncate", "flip", "empty", "text"])
def test_a_damaged_entry_is_made_anew(folder: Path, damage: str, caplog: pytest.LogCaptureFixture) -> None:
    cache.load_or_make("kind", KEY, _make)
    path = folder / "kind" / f"{KEY}.npz"
    data = bytearray(path.read_bytes())
    if damage == "flip":
        at = data.find(np.arange(6.0).reshape(2, 3).__truediv__(3).tobytes())
        data[at + 9] ^= 0xFF
    path.write_bytes({"truncate": bytes(data[:-40]), "flip": bytes(data), "empty": b"", "text": b"no archive"}[damage])
    with caplog.at_level(logging.WARNING):
        again = cache.load_or_make("kind", KEY, _make)
    np.testing.assert_array_equal(again["v"], _make()["v"])
    assert "is damaged" in caplog.text
    cache.load_or_make("kind", KEY, _refuse)


def test_an_entry_under_a_wrong_name_is_not_believed(folder: Path) -> None:
    cache.load_or_make("kind", KEY, _make)
    other = "cd" * 32
    (folder / "kind" / f"{KEY}.npz").rename(folder / "kind" / f"{other}.npz")
    assert cache.load_or_make("kind", other, lambda: {"v": np.zeros(1)})["v"].shape == (1,)


def test_pickles_are_not_read(folder: Path) -> None:
    path = folder / "kind" / f"{KEY}.npz"
    path.parent.mkdir(parents=True)
    np.savez(path, v=np.array([{"a": 1}], dtype=object), __key__=np.array(KEY))
    np.testing.assert_array_equal(cache.load_or_make("kind", KEY, _make)["v"], _make()["v"])


def test_a_folder_that_cannot_be_written_is_only_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("x")
    monkeypatch.setenv(cache.CACHE_ENV, str(tmp_path / "file" / "below"))
    with caplog.at_level(logging.WARNING):
        for _ in range(2):
            np.testing.assert_array_equal(cache.load_or_make("kind", KEY, _make)["v"], _make()["v"])
    assert caplog.text.count("going on without") == 1


def test_a_full_disk_leaves_nothing_behind(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    np.testing.assert_array_equal(cache.load_or_make("kind", KEY, _make)["v"], _make()["v"])
    assert not [p for p in folder.rglob("*") if p.is_file()]


def test_two_processes_at_once(folder: Path) -> None:
    script = (
        "import numpy as np\nfrom anysim import cache\n"
        "for i in range(60):\n"
        "    key = cache.digest(str(i % 6))\n"
        "    a = cache.load_or_make('kind', key, lambda: {'v': np.full(20000, i % 6)})['v']\n"
        "    assert a.shape == (20000,) and (a == i % 6).all()\n"
        "    if i % 7 == 0: (cache.cache_folder() / 'kind' / f'{key}.npz').unlink(missing_ok=True)\n"
    )
    runs = [subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.PIPE) for _ in range(2)]
    for run in runs:
        _, errors = run.communicate(timeout=120)
        assert run.returncode == 0, errors.decode()
        assert b"damaged" not in errors
    assert not list(folder.rglob("*.part"))


def test_digests_do_not_run_together() -> None:
    assert cache.digest("ab", "c") != cache.digest("a", "bc")
    assert cache.digest(b"ab") == cache.digest("ab")
