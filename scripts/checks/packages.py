"""The distributions agree with each other, are all known to the tools, and import lightly."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from packaging.requirements import Requirement

from checks.tree import Fault, Tree

SHARED = ("version", "requires-python", "license")
INIT_LINES = 60
LIGHT = (ast.Import, ast.ImportFrom, ast.Assign, ast.AnnAssign, ast.FunctionDef)


def check(tree: Tree) -> Iterator[Fault]:
    """Differences between the distributions' metadata, unlisted packages, and heavy `__init__` modules."""
    yield from _metadata(tree)
    yield from _known_to_tools(tree)
    yield from _libraries(tree)
    for path in tree.files:
        if path.name == "__init__.py" and path.parts[0] not in ("tests", "scripts", "docs", "benchmarks"):
            yield from _light(tree, path)


def _metadata(tree: Tree) -> Iterator[Fault]:
    first = tree.members[0]
    for member in tree.members:
        file = member.folder / "pyproject.toml"
        for key in SHARED:
            ours, theirs = member.project.get(key), first.project.get(key)
            if ours != theirs:
                yield Fault(
                    file, 0, f"{key} is {ours!r}, that of {first.folder} is {theirs!r}; all members agree on it"
                )
        package = member.folder / member.package
        for needed in (package / "__init__.py", package / "py.typed"):
            if not (tree.root / needed).is_file():
                yield Fault(needed, 0, f"missing; the distribution {member.project['name']} needs it")
        version = _assigned(tree.root / package / "__init__.py", "__version__")
        if version not in (None, member.project["version"]):
            yield Fault(
                package / "__init__.py",
                0,
                f"__version__ is {version!r}, pyproject.toml says {member.project['version']!r}; make them equal",
            )


def _known_to_tools(tree: Tree) -> Iterator[Fault]:
    tools = tree.settings["tool"]
    settings = Path("pyproject.toml")
    layers = tools["importlinter"]["contracts"][0]["layers"]
    layered = {package for layer in layers for package in layer.split(" | ")}
    for member in tree.members:
        name, package = member.project["name"], member.package
        if name not in tools["uv"]["sources"]:
            yield Fault(settings, 0, f"add {name} = {{ workspace = true }} to tool.uv.sources")
        if package not in tools["importlinter"]["root_packages"]:
            yield Fault(settings, 0, f"add {package} to root_packages of tool.importlinter")
        if package not in layered:
            yield Fault(settings, 0, f"add {package} to the layers of the first contract of tool.importlinter")
        if member.folder.as_posix() not in tools["pyright"]["extraPaths"]:
            yield Fault(settings, 0, f"add {member.folder.as_posix()} to extraPaths of tool.pyright")


def _libraries(tree: Tree) -> Iterator[Fault]:
    """What stands among the backends and is no engine: it offers nothing by itself, and backends alone build on it."""
    groups = {member.project["name"]: member.project.get("entry-points", {}) for member in tree.members}
    backends = [member for member in tree.members if member.folder.parts[0] == "backends"]
    engines = {name for name, own in groups.items() if "anysim.engines" in own}
    libraries = {member.project["name"] for member in backends} - engines
    for member in tree.members:
        name, file = member.project["name"], member.folder / "pyproject.toml"
        if name in libraries and groups[name]:
            yield Fault(file, 0, f"has entry points ({', '.join(groups[name])}) and no engine; move them to a plugin")
        extras = member.project.get("optional-dependencies", {}).values()
        wanted = [*member.project["dependencies"], *(text for extra in extras for text in extra)]
        for used in sorted(libraries & {Requirement(text).name for text in wanted}):
            if member not in backends:
                yield Fault(file, 0, f"depends on {used}, which is for backends alone; what plugins share is core's")


def _light(tree: Tree, path: Path) -> Iterator[Fault]:
    """An `__init__` holds a docstring, light imports, names, and at most the functions that make names lazy."""
    source = tree.text(path) or ""
    if (lines := len(source.splitlines())) > INIT_LINES:
        yield Fault(path, 0, f"{lines} lines; an __init__ has at most {INIT_LINES}: move the code to a module")
    module = ast.parse(source)
    if not ast.get_docstring(module):
        yield Fault(path, 1, "has no docstring; say in one sentence what the package is")
    for node in module.body:
        if _is_docstring(node) or _is_type_checking(node):
            continue
        if not isinstance(node, LIGHT):
            yield Fault(path, node.lineno, "runs code on import; move it to a module that is imported when it is used")
        for name in _imported(node):
            if name not in sys.stdlib_module_names and name not in path.parts:
                yield Fault(
                    path, node.lineno, f"imports {name}; an __init__ imports the standard library or its own package"
                )


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _is_type_checking(node: ast.stmt) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")


def _imported(node: ast.stmt) -> list[str]:
    """The top-level packages that an import statement names."""
    if isinstance(node, ast.Import):
        return [alias.name.partition(".")[0] for alias in node.names]
    if isinstance(node, ast.ImportFrom) and node.module and not node.level:
        return [node.module.partition(".")[0]]
    return []


def _assigned(path: Path, name: str) -> object:
    """The constant that a module assigns to a name, or None."""
    if not path.is_file():
        return None
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.Assign) and any(isinstance(t, ast.Name) and t.id == name for t in node.targets):
            return node.value.value if isinstance(node.value, ast.Constant) else None
    return None
