"""Order of the house: sizes, importers, names, docstrings, and counts that only fall."""

import ast
import re
from collections import defaultdict
from collections.abc import Collection, Iterator
from functools import cache
from pathlib import Path

from checks.tree import Fault, Member, Tree

CORE = Path("core/anysim")
TESTING = CORE / "testing"
CORE_LINES, CORE_FILES = 30_000, 210
"""What a run imports; what looks on, and what reads one format of files, is a plugin."""
PACKAGE_LINES, PACKAGE_MODULES = 4_000, 26
BACKEND_LINES = 2_500
"""Of an engine, and of the library that engines share."""
PLUGIN_LINES = 3_000
"""Of a plugin, and of each folder of a larger one, where what is deeper counts too."""
LARGE_PLUGINS = {
    "annotation": 3_100,  # one capture, of live worlds, records, streams, still images and data sets
    "assets": 4_320,  # builders of one kind (things, rooms, ground) that share their shapes and their parameters
    "control": 3_250,  # controllers of tools and vehicles: one kind of entry points, with an extra a solver
    "language": 4_200,  # questions and the checker that finds their answers again read the same episodes and words
    "parity": 3_660,  # one comparison: its layers and probes are read together, and its page shows all of them
    "sensors": 4_000,  # one geometry and every sensor that asks it: kernels, tables, and what worlds declare
    "skills": 10_060,  # one library of arms and phases that every group of skills builds on, a folder a group
    "usd": 3_600,  # the reader and the writer of one format, which share the attributes that carry every digit
}
"""Plugins that stay whole although they are larger, with what they may have: it rises with what they newly do alone."""

FMT_SKIPS = 77
"""How many `# fmt: skip` there may be; it marks tables alone, and the number only falls."""
ANY_IN_SIGNATURES = 132
"""How many parameters and results of core's public functions may name `Any`, as a whole (72) or inside, as
`Mapping[str, Any]` does; the number only falls."""

SENTENCE = re.compile(r"(What|Who|Whose|Where|How|Whether|When|Why|From|Whoeve[r])\b")
PUBLIC = frozenset({"anysim.skills.living_bank", "anysim.families.cosolver"})
"""Documented for authors of plugins, and used by one distribution so far: banks that change while a run goes on, and
matter with a solver of its own."""

LOCAL_NAMES = frozenset({"__init__", "__main__", "base"})
"""File names that are the same in many packages on purpose."""


def check(tree: Tree) -> Iterator[Fault]:
    """Everything of the house that can be counted."""
    yield from _sizes(tree)
    yield from _importers(tree)
    yield from _names(tree)
    yield from _private(tree)
    yield from _docstrings(tree)
    yield from _falling(tree)


def _core(tree: Tree) -> list[Path]:
    return [p for p in tree.under("core", suffixes=(".py",)) if CORE in p.parents and TESTING not in p.parents]


def _lines(tree: Tree, path: Path) -> int:
    return len((tree.text(path) or "").splitlines())


@cache
def _parsed(text: str) -> ast.Module:
    return ast.parse(text)


def _module(tree: Tree, path: Path) -> ast.Module:
    return _parsed(tree.text(path) or "")


def _sizes(tree: Tree) -> Iterator[Fault]:
    core = _core(tree)
    total = sum(_lines(tree, path) for path in core)
    if total > CORE_LINES:
        yield Fault(
            CORE, 0, f"{total} lines without testing/, {CORE_LINES} at most: move what no run needs to a plugin"
        )
    if len(core) > CORE_FILES:
        yield Fault(CORE, 0, f"{len(core)} files without testing/, {CORE_FILES} at most: one concept, one home")
    packages: dict[Path, list[Path]] = defaultdict(list)
    for path in tree.under("core", "backends", "plugins", "tasks", "schemas", suffixes=(".py",)):
        if TESTING not in path.parents:
            packages[path.parent].append(path)
    for package, paths in sorted(packages.items()):
        modules = [path for path in paths if path.name != "__init__.py"]
        if CORE in [package, *package.parents]:
            if len(modules) > PACKAGE_MODULES:
                yield Fault(package, 0, f"{len(modules)} modules, {PACKAGE_MODULES} at most: merge or split it")
            if (lines := sum(_lines(tree, path) for path in paths)) > PACKAGE_LINES:
                yield Fault(package, 0, f"{lines} lines, {PACKAGE_LINES} at most: split it at an idea")
    for member in tree.members:
        if member.folder.parts[0] == "backends":
            package = member.folder / member.package
            own = [p for p in tree.under("backends", suffixes=(".py",)) if package in p.parents]
            lines = sum(_lines(tree, path) for path in own if package / "mjcf" not in path.parents)
            limit = PLUGIN_LINES if member.folder.name == "mechanics" else BACKEND_LINES
            if lines > limit:
                words = "what knows arrays and no library belongs to mechanics"
                yield Fault(package, 0, f"{lines} lines, {limit} at most: {words}")
        if member.folder.parts[0] == "plugins":
            yield from _plugin_size(tree, member)


def _plugin_size(tree: Tree, member: Member) -> Iterator[Fault]:
    package = member.folder / member.package
    folders: dict[Path, int] = defaultdict(int)
    for path in tree.under("plugins", suffixes=(".py",)):
        if package in path.parents:
            inside = path.relative_to(package).parts[:-1]
            folders[package.joinpath(*inside[:1])] += _lines(tree, path)
    lines, limit = sum(folders.values()), LARGE_PLUGINS.get(member.folder.name, PLUGIN_LINES)
    if lines > limit:
        yield Fault(package, 0, f"{lines} lines, {limit} at most: split it into distributions")
    for folder, lines in folders.items() if limit > PLUGIN_LINES else ():
        if lines > PLUGIN_LINES:
            yield Fault(folder, 0, f"{lines} lines, {PLUGIN_LINES} at most: split the group")


def _dotted(path: Path) -> str:
    return ".".join(path.relative_to(CORE.parent).with_suffix("").parts).removesuffix(".__init__")


def _importers(tree: Tree) -> Iterator[Fault]:
    """Modules of core that neither core, nor an entry point, nor two other distributions use."""
    core = _core(tree)
    modules = {_dotted(path): path for path in core}
    named: set[str] = set()
    for path in core:
        named |= _imported(_module(tree, path), modules)
    users: dict[str, set[Path]] = defaultdict(set)
    for path in tree.under("backends", "plugins", "tasks", suffixes=(".py",)):
        for name in _imported(_module(tree, path), modules):
            users[name].add(Path(*path.parts[:2]))
    named |= {name for name, distributions in users.items() if len(distributions) > 1}
    own = next(member for member in tree.members if member.folder == CORE.parent).project
    for group in own.get("entry-points", {}).values():
        named.update(value.partition(":")[0] for value in group.values())
    named.update(value.partition(":")[0] for value in own.get("scripts", {}).values())
    for name, path in sorted(modules.items()):
        if name not in named and path.stem not in ("__init__", "__main__") and name not in PUBLIC:
            yield Fault(
                path, 0, "nothing in core imports it and no entry point names it: delete it or move it to its user"
            )


def _imported(module: ast.Module, modules: Collection[str]) -> set[str]:
    """Modules that a file imports or names in a string, as those do that are imported when they are used."""
    found: set[str] = set()
    for node in ast.walk(module):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value in modules:
            found.add(node.value)
    return found


def _names(tree: Tree) -> Iterator[Fault]:
    """Public classes with one name, and files with one name more than twice."""
    classes: dict[str, Path] = {}
    files: dict[str, list[Path]] = defaultdict(list)
    for path in _core(tree):
        files[path.stem].append(path)
        for node in _module(tree, path).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                if node.name in classes:
                    yield Fault(
                        path,
                        node.lineno,
                        f"the class {node.name} is in {classes[node.name]} too; give it a name of its own",
                    )
                classes.setdefault(node.name, path)
    for stem, paths in sorted(files.items()):
        if len(paths) > 2 and stem not in LOCAL_NAMES:
            others = ", ".join(str(path) for path in paths[:-1])
            yield Fault(paths[-1], 0, f"{len(paths)} files are called {stem} ({others}); two at most")


def _private(tree: Tree) -> Iterator[Fault]:
    """Suppressed access to privates in core."""
    for path in _core(tree):
        for number, line in enumerate((tree.text(path) or "").splitlines(), 1):
            if "SLF001" in line:
                yield Fault(
                    path, number, "uses what is private to another class; give it a public name or move the code"
                )


def _docstrings(tree: Tree) -> Iterator[Fault]:
    """Modules whose docstring begins with a question word."""
    for path in tree.under(
        "core", "schemas", "backends", "plugins", "tasks", "scripts", "tests", "benchmarks", suffixes=(".py",)
    ):
        text = ast.get_docstring(_module(tree, path)) or ""
        if found := SENTENCE.match(text):
            yield Fault(
                path, 1, f"the docstring begins with '{found[0]}'; begin with the noun that the module is about"
            )


def _falling(tree: Tree) -> Iterator[Fault]:
    """Counts that only fall."""
    skips = sum((tree.text(path) or "").count("# fmt: " + "skip") for path in tree.under(suffixes=(".py",)))
    if skips > FMT_SKIPS:
        yield Fault(Path(), 0, f"{skips} lines are kept from the formatter, {FMT_SKIPS} at most: tables alone need it")
    anything = sum(_anys(node) for path in _core(tree) for node in ast.walk(_module(tree, path)))
    if anything > ANY_IN_SIGNATURES:
        yield Fault(
            CORE, 0, f"`Any` is in {anything} hints of public signatures, {ANY_IN_SIGNATURES} at most: name the type"
        )


def _anys(node: ast.AST) -> int:
    """How many parameters and results of a public function name `Any`."""
    if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
        return 0
    hints = [argument.annotation for argument in [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]]
    return sum(_names_any(hint) for hint in [*hints, node.returns] if hint is not None)


def _names_any(hint: ast.expr) -> bool:
    return any(isinstance(part, ast.Name) and part.id == "Any" for part in ast.walk(hint))
