"""Past participles as names: not of a class, a function and a variable at once, which no reader can tell apart."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from checks.tree import Fault, Tree

PARTICIPLE = re.compile(
    r"\w{2,}[^e]ed|built|drawn|found|given|gone|held|hung|kept|known|left|lost|made|said|seen|sent|shown|taken|told|worn"
    r"|written"
)
NOUNS = ("core", "schemas", "backends", "plugins", "tasks")
"""Where classes are called by nouns."""
TERMS = Path("core/anysim/task/terms")
"""A class there is called as its term is in YAML: `turned`."""


def check(tree: Tree) -> Iterator[Fault]:
    """Classes whose name is a past participle that functions and variables have as well."""
    functions: set[str] = set()
    variables: set[str] = set()
    classes: list[tuple[str, Fault]] = []
    for path in tree.under(*NOUNS, suffixes=(".py",)):
        for node in ast.walk(ast.parse(tree.text(path) or "")):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                functions.add(node.name.strip("_"))
            elif isinstance(node, ast.arg):
                variables.add(node.arg.strip("_"))
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                variables.add(node.id.strip("_"))
            elif isinstance(node, ast.ClassDef) and TERMS not in path.parents:
                remedy = f"{node.name} is a function and a variable too; call the class by a noun"
                classes.append((node.name.strip("_").lower(), Fault(path, node.lineno, remedy)))
    for name, fault in classes:
        if PARTICIPLE.fullmatch(name) and name in functions and name in variables:
            yield fault
