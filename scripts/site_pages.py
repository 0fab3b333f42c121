"""Pages of the documentation site that are no files of docs/: the API, and what pages link to elsewhere.

A hook of MkDocs (see mkdocs.yml). A page of the API covers one package and is made of its docstrings, which are read
without importing anything.
"""

import ast
import logging
import posixpath
import re
from collections.abc import Iterator
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files, InclusionLevel
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
HOME = {"README.md": "index.md", "docs/README.md": "contents.md"}
"""Files with another place in the site: it begins with the README of the repository."""
OUTSIDE = "repository"
"""The folder of the site for what pages link to outside of docs/."""
LINK = re.compile(r"(\]\(<?)([^)\s#>]+)")
EXCERPT = re.compile(r"^```(\w+) (\S+)$", re.MULTILINE)
"""The first line of an excerpt from a file: what GitHub ignores is a title here."""
FROM_NETWORK = re.compile(r"""<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)=["']?(?:https?:)?//[^\s"'>]+""")
LOG = logging.getLogger("mkdocs.hooks.site_pages")
OFF_NAV = InclusionLevel.NOT_IN_NAV
GROUPS = (
    ("Core", ("schemas", "core")),
    ("Engines", ("backends/*",)),
    ("Plugins", ("plugins/*",)),
    ("Tasks", ("tasks",)),
)


@event_priority(100)  # before the plugin that reads docstrings looks at its settings
def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Where the sources are, and the navigation: the home page, the docs by folder, the API by group."""
    handlers = config.plugins["mkdocstrings"].config["handlers"]
    handlers["python"]["paths"] = [str(member) for _, folders in GROUPS for member in _members(folders)]
    docs = ROOT / "docs"
    config.nav = [
        {"Home": "index.md"},
        {"Contents": "contents.md"},
        {"Guides": sorted(page.name for page in docs.glob("*.md") if page.name != "README.md")},
        {"Concepts": sorted(f"concepts/{page.name}" for page in (docs / "concepts").glob("*.md"))},
        {"Example worlds": "worlds/README.md"},
        {"Examples": "examples/README.md"},
        {"API": [{title: [_api_path(name) for name, _ in _packages(folders)]} for title, folders in GROUPS]},
    ]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages, and every file that a page links to."""
    for source, place in HOME.items():
        if (there := files.get_file_from_path(source.removeprefix("docs/"))) is not None:
            files.remove(there)
        files.append(File.generated(config, place, abs_src_path=str(ROOT / source)))
    for _, folders in GROUPS:
        for name, modules in _packages(folders):
            files.append(File.generated(config, _api_path(name), content=_api_page(name, modules)))
    waiting = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    seen = set(waiting)
    while waiting:
        page = waiting.pop()
        for match in LINK.finditer(page.read_text("utf-8")):
            target = _target(page.relative_to(ROOT).as_posix(), match[2])
            if target is None or (path := ROOT / target) in seen or target.startswith("docs/"):
                continue
            seen.add(path)
            files.append(File.generated(config, _place(target), abs_src_path=str(path), inclusion=OFF_NAV))
            if path.suffix == ".md":
                waiting.append(path)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn links between files of the repository into links between pages, and names of excerpts into titles."""
    markdown = EXCERPT.sub(r'```\1 title="\2"', markdown)
    source = page.file.abs_src_path
    if source is None or not Path(source).is_relative_to(ROOT):
        return markdown
    here = Path(source).relative_to(ROOT).as_posix()

    def rewrite(match: re.Match[str]) -> str:
        target = _target(here, match[2])
        if target is None:
            return match[0]
        return match[1] + posixpath.relpath(_place(target), posixpath.dirname(page.file.src_uri) or ".")

    return LINK.sub(rewrite, markdown)


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Warn of what a reader's browser would fetch from elsewhere; `make site` fails at a warning."""
    for found in FROM_NETWORK.findall(output):
        LOG.warning("%s loads from the network: %s", page.file.src_uri, found)
    return output


def _target(page: str, link: str) -> str | None:
    """The file of the repository, relative to its root, that a link of a page means; None for another address."""
    if re.match(r"[a-z][a-z+.-]*:", link):
        return None
    target = posixpath.normpath(
        link.lstrip("/") if link.startswith("/") else posixpath.join(posixpath.dirname(page), link)
    )
    return target if (ROOT / target).is_file() else None


def _place(target: str) -> str:
    """Where a file of the repository lies in the site."""
    if target in HOME:
        return HOME[target]
    return target.removeprefix("docs/") if target.startswith("docs/") else f"{OUTSIDE}/{target}"


def _members(folders: tuple[str, ...]) -> list[Path]:
    return sorted(found for pattern in folders for found in ROOT.glob(pattern))


def _packages(folders: tuple[str, ...]) -> Iterator[tuple[str, list[str]]]:
    """The packages of some members with the public modules right inside them, tests and data left out."""
    for member in _members(folders):
        for init in sorted(member.glob("anysim*/**/__init__.py")):
            name = ".".join(init.parent.relative_to(member).parts)
            modules = [
                f.stem for f in sorted(init.parent.glob("*.py")) if not f.stem.startswith(("_", "test_", "conftest"))
            ]
            if modules:
                yield name, [f"{name}.{module}" for module in modules]


def _api_path(name: str) -> str:
    return f"api/{name}.md"


def _api_page(name: str, modules: list[str]) -> str:
    return "\n\n".join([f"# {name}", _summary(name), *(f"::: {module}" for module in modules)]) + "\n"


def _summary(name: str) -> str:
    """The docstring of a package."""
    (init,) = (
        path
        for _, folders in GROUPS
        for f in folders
        for path in ROOT.glob(f"{f}/{name.replace('.', '/')}/__init__.py")
    )
    return ast.get_docstring(ast.parse(init.read_text("utf-8"))) or ""
