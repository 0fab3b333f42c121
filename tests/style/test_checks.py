"""Each check of the repository finds the fault that it is for, and nothing in a tree without faults."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import check_style
import pytest
from checks import constraints, house, junk, length, links, packages, participles, words, yaml_header
from checks.tree import Tree

ROOT_SETTINGS = """
[tool.uv.workspace]
members = ["core", "plugins/*"]
[tool.uv.sources]
anysim = { workspace = true }
anysim-x = { workspace = true }
[tool.importlinter]
root_packages = ["anysim", "anysim_x"]
[[tool.importlinter.contracts]]
layers = ["anysim_x", "anysim"]
[tool.pyright]
extraPaths = ["core", "plugins/x"]
[dependency-groups]
dev = ["ruff>=0.9"]
"""
MEMBER = """
[project]
name = "{name}"
version = "0.1.0"
requires-python = ">=3.11"
license = "Apache-2.0"
dependencies = {dependencies}
"""
CLEAN = {
    "pyproject.toml": ROOT_SETTINGS,
    "constraints.txt": "# header\nmujoco==3.17.0\nnumpy==2.4.6\nruff==0.17.5 ; sys_platform == 'linux'\n",
    "Makefile": "test: venv  ## run\nvenv:\n",
    "README.md": "Run `make test` to\nmake sure; see [the core](core/anysim/__init__.py#top) and [a page](https://example.com/x).\n",
    "core/pyproject.toml": MEMBER.format(name="anysim", dependencies=["numpy>=2.0", "mujoco"]),
    "core/anysim/__init__.py": '"""The core."""\n\nfrom anysim.a import b\n\n__version__ = "0.1.0"\n',
    "core/anysim/py.typed": "",
    "plugins/x/pyproject.toml": MEMBER.format(name="anysim-x", dependencies=["anysim"]),
    "plugins/x/anysim_x/__init__.py": '"""A plugin."""\n',
    "plugins/x/anysim_x/py.typed": "",
    "plugins/x/anysim_x/arm.yaml": "# yaml-language-server: $schema=../../../schemas/json/robot.json\nname: arm\n",
    "schemas/json/robot.json": "{}\n",
}
MakeTree = Callable[[dict[str, str]], Tree]


@pytest.fixture
def make_tree(tmp_path: Path) -> MakeTree:
    """A tree without faults, changed by the files that are given."""

    def make(changes: dict[str, str]) -> Tree:
        files = CLEAN | changes
        for name, text in files.items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, "utf-8")
        return Tree(tmp_path, tuple(sorted(Path(name) for name in files)))

    return make


def test_a_clean_tree_has_no_faults(make_tree: MakeTree) -> None:
    tree = make_tree({})
    assert [str(fault) for check in check_style.CHECKS for fault in check(tree)] == []


@pytest.mark.parametrize(("lines", "expected"), [(350, []), (351, [False]), (600, [False]), (601, [True])])
def test_length_warns_then_fails(make_tree: MakeTree, lines: int, expected: list[bool]) -> None:
    assert [fault.fatal for fault in length.check(make_tree({"core/anysim/long.py": "x = 1\n" * lines}))] == expected


A = "core/anysim/a.py"
LONG = '"""A module."""\n' + "x = 1\n" * 9
SKIP = "# fmt: " + "skip"


def told(tree: Tree) -> list[str]:
    return [str(fault) for fault in house.check(tree)]


@pytest.mark.parametrize(
    ("limit", "value", "inside", "outside", "message"),
    [
        ("CORE_LINES", 14, A, "core/anysim/testing/a.py", "core/anysim: 15 lines without testing/, 14 at most"),
        ("CORE_FILES", 1, A, "core/anysim/testing/a.py", "core/anysim: 2 files without testing/, 1 at most"),
        ("PACKAGE_LINES", 14, A, "plugins/x/anysim_x/a.py", "core/anysim: 15 lines, 14 at most"),
        ("PACKAGE_MODULES", 0, A, "plugins/x/anysim_x/a.py", "core/anysim: 1 modules, 0 at most"),
        ("PLUGIN_LINES", 10, "plugins/x/anysim_x/a.py", A, "plugins/x/anysim_x: 11 lines, 10 at most"),
    ],
)
def test_what_is_too_large_is_found_where_it_counts(
    make_tree: MakeTree,
    monkeypatch: pytest.MonkeyPatch,
    limit: str,
    value: int,
    inside: str,
    outside: str,
    message: str,
) -> None:
    monkeypatch.setattr(house, limit, value)
    (fault,) = told(make_tree({inside: LONG}))
    assert fault.startswith(message)
    assert told(make_tree({outside: LONG})) == []


def test_a_plugin_that_may_be_large_has_folders_that_are_not(
    make_tree: MakeTree, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(house, "PLUGIN_LINES", 21)
    monkeypatch.setattr(house, "LARGE_PLUGINS", {"x": 50})
    pieces = {f"plugins/x/anysim_x/{name}.py": LONG for name in ("a/one", "a/two", "b/one", "c")}
    assert told(make_tree(pieces)) == []
    (fault,) = told(make_tree({**pieces, "plugins/x/anysim_x/a/deeper/three.py": LONG}))[1:]
    assert fault.startswith("plugins/x/anysim_x/a: 30 lines, 21 at most: split the group")


def test_a_backend_that_is_too_large_is_found(make_tree: MakeTree, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = ROOT_SETTINGS.replace('"plugins/*"', '"plugins/*", "backends/*"')
    member = MEMBER.format(name="anysim-y", dependencies=["anysim"])
    backend = {"pyproject.toml": settings, "backends/y/pyproject.toml": member}
    monkeypatch.setattr(house, "BACKEND_LINES", 10)
    assert told(make_tree({**backend, "backends/y/anysim_y/a.py": LONG})) == []
    (fault,) = told(make_tree({**backend, "backends/y/anysim_y/a.py": LONG + "\n"}))
    assert fault.startswith("backends/y/anysim_y: 11 lines, 10 at most")


def test_a_module_of_core_without_an_importer_is_found(make_tree: MakeTree) -> None:
    lonely = {"core/anysim/lonely.py": '"""L."""\n'}
    (fault,) = told(make_tree(lonely))
    assert fault.startswith("core/anysim/lonely.py: nothing in core imports it and no entry point names it")
    uses = '"""U."""\n\nfrom anysim import lonely\n'
    entry = CLEAN["core/pyproject.toml"] + '[project.entry-points."anysim.terms"]\nx = "anysim.lonely:X"\n'
    assert len(told(make_tree({**lonely, "plugins/x/anysim_x/a.py": uses}))) == 1, "one distribution is not enough"
    assert told(make_tree({**lonely, "plugins/x/anysim_x/a.py": uses, "tasks/anysim_tasks/a.py": uses})) == []
    assert told(make_tree({**lonely, A: uses})) == []
    assert told(make_tree({**lonely, "core/pyproject.toml": entry})) == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {A: '"""A."""\n\n\nclass Pool:\n    pass\n', "core/anysim/b/a.py": '"""B."""\n\n\nclass Pool:\n    pass\n'},
            "core/anysim/b/a.py:4: the class Pool is in core/anysim/a.py too",
        ),
        (
            {f"core/anysim/{folder}a.py": '"""A."""\n' for folder in ("", "b/", "c/")},
            "core/anysim/c/a.py: 3 files are called a (core/anysim/a.py, core/anysim/b/a.py)",
        ),
        ({A: '"""A."""\n\nx.y._z  # noqa: SLF001\n'}, "core/anysim/a.py:3: uses what is private"),
        ({"tests/a.py": '"""What it is."""\n'}, "tests/a.py:1: the docstring begins with 'What'"),
    ],
    ids=["classes", "files", "private", "docstring"],
)
def test_names_that_confuse_are_found(make_tree: MakeTree, changes: dict[str, str], message: str) -> None:
    named = {"core/anysim/__init__.py": '"""The core."""\n\nfrom anysim import a, b, c\nfrom anysim.b import a as d\n'}
    named["core/anysim/__init__.py"] += 'from anysim.c import a as e\n\n__version__ = "0.1.0"\n'
    (fault,) = told(make_tree({**named, **changes}))
    assert fault.startswith(message)


@pytest.mark.parametrize(
    "text",
    [
        '"""A."""\n\n\nclass _Pool:\n    pass\n\n\nclass _Pool:\n    pass\n',
        '"""Whatever has a noun: what comes later is free."""\n',
        "x = 1\n",
    ],
    ids=["private classes", "another word", "no docstring"],
)
def test_names_that_do_not_confuse_are_free(make_tree: MakeTree, text: str) -> None:
    assert told(make_tree({A: text})) == []


@pytest.mark.parametrize(
    ("limit", "fits", "too_many", "message"),
    [
        ("FMT_SKIPS", f"x = 1  {SKIP}\n", f"y = 2  {SKIP}\n", "2 lines are kept from the formatter, 1 at most"),
        ("ANY_IN_SIGNATURES", "def f(a: Any) -> int: ...\n", "def g() -> Any: ...\n", "`Any` is in 2 hints"),
        ("ANY_IN_SIGNATURES", "def f(a: Any): ...\n", "def g(*, b: dict[str, Any]): ...\n", "`Any` is in 2 hints"),
        (
            "ANY_IN_SIGNATURES",
            "def f(a: Any, b): ...\ndef _g(a: Any): ...\n",
            "def h(a: Any, /): ...\n",
            "`Any` is in 2",
        ),
    ],
)
def test_counts_that_only_fall(
    make_tree: MakeTree, monkeypatch: pytest.MonkeyPatch, limit: str, fits: str, too_many: str, message: str
) -> None:
    monkeypatch.setattr(house, limit, 1)
    assert told(make_tree({A: fits})) == []
    (fault,) = told(make_tree({A: fits + too_many}))
    assert message in fault


KEPT = '"""K."""\n\n\nclass {}:\n    pass\n\n\ndef {}(rows): ...\n\n\n{} = 1\n'


@pytest.mark.parametrize(
    "names", [("Kept", "kept", "kept"), ("_Kept", "_kept", "kept"), ("Placed", "placed", "_placed")]
)
def test_a_participle_of_three_kinds_is_found(make_tree: MakeTree, names: tuple[str, str, str]) -> None:
    (fault,) = participles.check(make_tree({A: KEPT.format(*names)}))
    assert str(fault).startswith(f"core/anysim/a.py:4: {names[0]} is a function and a variable too")
    alone = KEPT.format(names[0], "f", names[2])
    assert list(participles.check(make_tree({A: alone}))) == [], "no function"
    assert list(participles.check(make_tree({"tests/a.py": KEPT.format(*names)}))) == [], "tests may"


@pytest.mark.parametrize(
    "names", [("Placement", "placed", "placed"), ("Speed", "speed", "speed"), ("PlacedPart", "placed", "placed_part")]
)
def test_nouns_are_names_of_all_kinds(make_tree: MakeTree, names: tuple[str, str, str]) -> None:
    assert list(participles.check(make_tree({A: KEPT.format(*names)}))) == []


@pytest.mark.parametrize(
    "text",
    [
        "open('/ro" + "ot/data')",
        "cd /ho" + "me/ada/anysim",
        "path: /Us" + "ers/ada/anysim/",
        r"C:\Us" + r"ers\ada",
        "--index-url https://py" + "pi.org/simple",
        "https://files.python" + "hosted.org/packages/x.whl",
        "registry.npm" + "js.org",
    ],
)
def test_words_of_one_machine_are_found(make_tree: MakeTree, text: str) -> None:
    faults = list(words.check(make_tree({"docs/page.md": f"first\n{text}\n"})))
    assert [(fault.path.as_posix(), fault.line) for fault in faults] == [("docs/page.md", 2)]


@pytest.mark.parametrize("text", ["for whoeve" + "r reads it", "Who is ther" + "e now", "nobody'" + "s wish"])
def test_persons_for_things_are_found(make_tree: MakeTree, text: str) -> None:
    (fault,) = words.check(make_tree({"docs/page.md": f"first\n{text}\n"}))
    assert (fault.line, "not plain English" in fault.message) == (2, True)


@pytest.mark.parametrize(
    "text", ["~/data", "$HOME/data", "the root/ folder", "https://x.com/home/ada", "a/work/b", "it is there"]
)
def test_other_paths_are_allowed(make_tree: MakeTree, text: str) -> None:
    assert list(words.check(make_tree({"docs/page.md": text}))) == []


@pytest.mark.parametrize(
    "name", ["MUJOCO_LOG.TXT", "core/anysim/__pycache__/a.pyc", "core/anysim.egg-info/PKG-INFO", "uv.lock", "a.py.orig"]
)
def test_junk_is_found(make_tree: MakeTree, name: str) -> None:
    assert [fault.path.as_posix() for fault in junk.check(make_tree({name: ""}))] == [name]


def test_a_large_file_is_found(make_tree: MakeTree) -> None:
    (fault,) = junk.check(make_tree({"docs/picture.svg": "x" * 1_000_001}))
    assert "1.0 MB" in fault.message


def test_binary_files_are_not_read_as_text(make_tree: MakeTree) -> None:
    assert list(words.check(make_tree({"a.bin": "\0 /ro" + "ot/x"}))) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name: arm\n", "its first line must name its schema"),
        ("# yaml-language-server: $schema=missing.json\n", "missing.json does not exist"),
    ],
)
def test_yaml_without_its_schema_is_found(make_tree: MakeTree, text: str, message: str) -> None:
    (fault,) = yaml_header.check(make_tree({"plugins/x/anysim_x/arm.yaml": text}))
    assert message in fault.message


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("x = 1\n", "no docstring"),
        ('"""P."""\nimport numpy\n', "imports numpy"),
        ('"""P."""\nfor i in range(3):\n    pass\n', "runs code on import"),
        ('"""P."""\n' + "a = 1\n" * 60, "at most 60"),
        ('"""P."""\n__version__ = "0.2.0"\n', "__version__ is '0.2.0'"),
    ],
)
def test_a_heavy_or_wrong_init_is_found(make_tree: MakeTree, source: str, message: str) -> None:
    faults = list(packages.check(make_tree({"plugins/x/anysim_x/__init__.py": source})))
    assert any(message in fault.message for fault in faults), faults


def test_type_checking_imports_of_an_init_are_free(make_tree: MakeTree) -> None:
    source = '"""P."""\nfrom typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n    import numpy\n'
    assert list(packages.check(make_tree({"plugins/x/anysim_x/__init__.py": source}))) == []


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("0.1.0", "0.2.0", "version is '0.2.0'"),
        (">=3.11", ">=3.12", "requires-python is '>=3.12'"),
        ("Apache-2.0", "MIT", "license is 'MIT'"),
        ("anysim-x", "anysim-y", "add anysim-y"),
    ],
)
def test_distributions_that_disagree_are_found(make_tree: MakeTree, old: str, new: str, message: str) -> None:
    changed = CLEAN["plugins/x/pyproject.toml"].replace(old, new)
    faults = list(packages.check(make_tree({"plugins/x/pyproject.toml": changed})))
    assert any(message in fault.message for fault in faults), faults


def test_a_package_unknown_to_the_tools_is_found(make_tree: MakeTree) -> None:
    settings = ROOT_SETTINGS.replace('"plugins/x"]', "]").replace("anysim-x = ", "other = ")
    settings = settings.replace(', "anysim_x"', "").replace('"anysim_x", ', "")
    messages = [fault.message for fault in packages.check(make_tree({"pyproject.toml": settings}))]
    assert len(messages) == 4


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({}, ""),
        (
            {"backends/m/pyproject.toml": '\n[project.entry-points."anysim.terms"]\nm = "anysim_m"\n'},
            "has entry points",
        ),
        ({"plugins/x/pyproject.toml": '\n[project.optional-dependencies]\nm = ["anysim-m"]\n'}, "for backends alone"),
    ],
)
def test_a_library_of_backends_is_for_backends(make_tree: MakeTree, change: dict[str, str], message: str) -> None:
    """It has no entry points, and neither core nor plugins nor tasks build on it; a backend may."""
    settings = ROOT_SETTINGS.replace('"plugins/*"', '"plugins/*", "backends/*"').replace(
        "anysim-x = ", "anysim-m = { workspace = true }\nanysim-e = { workspace = true }\nanysim-x = "
    )
    settings = settings.replace(', "anysim_x"]', ', "anysim_x", "anysim_m", "anysim_e"]')
    settings = settings.replace('layers = ["anysim_x", ', 'layers = ["anysim_x | anysim_e", "anysim_m", ')
    settings = settings.replace('"plugins/x"]', '"plugins/x", "backends/m", "backends/e"]')
    files = {"pyproject.toml": settings, "plugins/x/pyproject.toml": CLEAN["plugins/x/pyproject.toml"]}
    for letter, needed in (("m", ["anysim"]), ("e", ["anysim-m"])):
        files[f"backends/{letter}/pyproject.toml"] = MEMBER.format(name=f"anysim-{letter}", dependencies=needed)
        files[f"backends/{letter}/anysim_{letter}/__init__.py"] = '"""One."""\n'
        files[f"backends/{letter}/anysim_{letter}/py.typed"] = ""
    files["backends/e/pyproject.toml"] += '\n[project.entry-points."anysim.engines"]\ne = "anysim_e:E"\n'
    found = [fault.message for fault in packages.check(make_tree(files | {k: files[k] + v for k, v in change.items()}))]
    assert len(found) == len(change), found
    assert all(message in text for text in found)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("numpy==2.4.6\nmujoco==3.17.0\nruff==0.17.5\n", "mujoco comes after numpy"),
        ("mujoco==3.17.0\nnumpy==2.4.6\nruff @ https://example.com/ruff.whl\n", "is not 'name==version'"),
        ("mujoco==3.17.0\nnumpy>=2\nruff==0.17.5\n", "is not 'name==version'"),
        ("mujoco==3.17.0\nnumpy==1.26.0\nruff==0.17.5\n", "'numpy>=2.0' excludes 1.26.0"),
        ("mujoco==3.17.0\nnumpy==2.4.6\n", "ruff is not in constraints.txt"),
        ("mujoco==4.0.0\nnumpy==2.4.6\nruff==0.17.5\n", "mujoco must be 3.17.0"),
        ("mujoco==3.17.0\nnumpy==2.4.6\nruff==0.17.5\ntorch==2.9.0\n", "torch is not part"),
    ],
)
def test_faults_of_the_constraints_are_found(make_tree: MakeTree, text: str, message: str) -> None:
    messages = [fault.message for fault in constraints.check(make_tree({"constraints.txt": text}))]
    assert any(message in found for found in messages), messages


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("See [x](missing.md).", "missing.md leads nowhere"),
        ("Run `make tets`.", "there is no `make tets`"),
        ("    $ make demo", "there is no `make demo`"),
        ("make demo DEMO_OUT=x", "there is no `make demo`"),
    ],
)
def test_names_in_documents_that_do_not_exist_are_found(make_tree: MakeTree, text: str, message: str) -> None:
    (fault,) = links.check(make_tree({"docs/page.md": text}))
    assert message in fault.message


def test_the_tree_of_a_repository_is_what_git_would_add(tmp_path: Path) -> None:
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    for name in (".gitignore", "kept.py", "ignored.log", "deleted.py"):
        (tmp_path / name).write_text("*.log\n" if name == ".gitignore" else "", "utf-8")
    subprocess.run(["git", "add", "deleted.py"], cwd=tmp_path, check=True)
    (tmp_path / "deleted.py").unlink()
    assert [path.as_posix() for path in Tree.of(tmp_path).files] == [".gitignore", "kept.py"]


def test_a_fault_prints_its_place_first() -> None:
    fault = words.Fault(Path("a/b.py"), 3, "is wrong; do it right")
    assert str(fault) == "a/b.py:3: is wrong; do it right"
    assert str(fault._replace(line=0, fatal=False)) == "a/b.py: warning: is wrong; do it right"
