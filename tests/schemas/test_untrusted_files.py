"""Files that nobody should read: devices, pipes, foreign and endless ones. None of them is read, or hangs."""

import os
import time
from pathlib import Path

import pytest

from anysim_schemas.errors import SpecError
from anysim_schemas.faults import MAX_FAULTS
from anysim_schemas.files import RefusedFileError, project_root, read_plain
from anysim_schemas.limits import YAML_BYTES, YAML_FILES, YAML_VALUES, Limit
from anysim_schemas.load import load_run

SECRET = "root:x:0:0:secret"


def refused(source: object) -> str:
    with pytest.raises(SpecError) as caught:
        load_run(source)  # type: ignore[arg-type]
    return str(caught.value)


@pytest.fixture
def inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder without a project around it, and a secret beside it."""
    (tmp_path / "secret").write_text(SECRET)
    folder = tmp_path / "mine"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.mark.parametrize("target", ["/dev/zero", "../secret", "/etc/passwd", "link.yaml", "deep/../../secret"])
def test_what_is_extended_stays_below_the_root(inside: Path, target: str) -> None:
    (inside / "link.yaml").symlink_to("../secret")
    (inside / "top.yaml").write_text(f"extends: {target}\n")
    for source in ("top.yaml", {"extends": target}):
        message = refused(source)
        assert f"lies outside of {inside}" in message
        assert "root:" not in message


def test_a_project_is_one_root(inside: Path) -> None:
    (inside / "top.yaml").write_text("extends: ../base.yaml")
    (inside.parent / "base.yaml").write_text("seed: 4")
    assert "lies outside of" in refused("top.yaml")
    (inside.parent / "pyproject.toml").touch()
    assert load_run("top.yaml").spec.seed == 4
    assert project_root(inside) == inside.parent


def test_a_package_is_one_root(inside: Path) -> None:
    deep = inside / "pack" / "family" / "task"
    deep.mkdir(parents=True)
    for folder in (deep, deep.parent, deep.parent.parent):
        (folder / "__init__.py").touch()
    assert project_root(deep) == inside / "pack"


def test_a_pipe_does_not_wait_and_a_device_does_not_flow(inside: Path) -> None:
    os.mkfifo(inside / "pipe.yaml")
    (inside / "top.yaml").write_text("extends: pipe.yaml")
    assert "the file 'pipe.yaml' that it extends is a pipe, not a file" in refused("top.yaml")
    assert refused("pipe.yaml") == "pipe.yaml: it is a pipe, not a file"
    assert refused("/dev/zero") == "/dev/zero: it is a device, not a file"


def test_a_large_file_is_refused_unread(inside: Path) -> None:
    with (inside / "large.yaml").open("wb") as file:
        file.truncate(YAML_BYTES.value + 1)
    assert refused("large.yaml") == f"large.yaml: it {YAML_BYTES.sentence(YAML_BYTES.value + 1)}"
    (inside / "many.yaml").write_text("a: [" + "0," * YAML_VALUES.value + "]")
    assert refused("many.yaml") == f"many.yaml:1:1: the file {YAML_VALUES.sentence()}"


def test_a_file_that_is_no_spec_is_not_quoted(inside: Path) -> None:
    (inside / "text.yaml").write_text(SECRET)
    (inside / "top.yaml").write_text("extends: text.yaml")
    assert "secret" not in refused("top.yaml")


def test_files_are_counted(inside: Path) -> None:
    (inside / "base.yaml").write_text("seed: 1")
    (inside / "top.yaml").write_text("extends: [" + "base.yaml," * (YAML_FILES.value + 5) + "]")
    assert refused("top.yaml").count(YAML_FILES.sentence(YAML_FILES.value + 1)) == 1


@pytest.mark.parametrize("name", ["a\0b", "n" * 5000, "loop"])
def test_a_name_that_is_none(inside: Path, name: str) -> None:
    (inside / "loop").symlink_to("loop")
    assert "extends" in refused({"extends": name})


def test_what_grows_while_it_is_read_is_noticed() -> None:
    with pytest.raises(RefusedFileError, match="has more bytes than its size says; copy it first"):
        read_plain(Path("/proc/self/status"), Limit(1 << 20, "bytes", "a thing", "shrink it"))  # says that it has 0


def test_of_many_faults_some_are_put_into_words(inside: Path) -> None:
    (inside / "keys.yaml").write_text("world:\n" + "".join(f"  k{i}: 0\n" for i in range(20_000)))
    start = time.perf_counter()
    lines = refused("keys.yaml").splitlines()
    assert time.perf_counter() - start < 10.0
    assert lines[0] == f"keys.yaml:1:1: there are 20,000 faults; {MAX_FAULTS:,} of them follow"
    assert len(lines) == 1 + MAX_FAULTS
