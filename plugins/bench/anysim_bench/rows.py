"""Tables that are printed row by row, as measurements end."""

from collections.abc import Sequence
from typing import Any

import typer

from anysim.cli.output import interactive


class Rows:
    """A table whose rows appear at once: in columns for a person, separated by tabs in a pipe, nowhere if `quiet`.

    A column is as wide as its head and `widths` gives it, so that rows that are not known yet stand below each other.
    """

    def __init__(self, title: str, heads: Sequence[str], widths: Sequence[int] = (), quiet: bool = False) -> None:
        self._quiet, self._tabs = quiet, not interactive()
        least = [*widths, *([0] * (len(heads) - len(widths)))]
        self._widths = [max(len(head), width) for head, width in zip(heads, least, strict=True)]
        if not self._tabs:
            self._print(title)
        self.add(*heads)

    def add(self, *cells: Any) -> None:
        """Print a row."""
        texts = [str(cell) for cell in cells]
        padded = "  ".join(text.ljust(width) for text, width in zip(texts, self._widths, strict=True)).rstrip()
        self._print("\t".join(texts) if self._tabs else padded)

    def _print(self, line: str) -> None:
        if not self._quiet:
            typer.echo(line)
