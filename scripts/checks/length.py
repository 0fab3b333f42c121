"""Files stay short: one idea each."""

from collections.abc import Iterator

from checks.tree import Fault, Tree

LONG, TOO_LONG = 350, 600


def check(tree: Tree) -> Iterator[Fault]:
    """Python files of more than TOO_LONG lines; a warning from LONG on."""
    for path in tree.under(suffixes=(".py",)):
        lines = len((tree.text(path) or "").splitlines())
        if lines > LONG:
            limit = TOO_LONG if lines > TOO_LONG else LONG
            yield Fault(path, 0, f"{lines} lines; split it at an idea (at most {limit})", fatal=lines > TOO_LONG)
