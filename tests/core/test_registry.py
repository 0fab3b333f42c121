"""Remedies for what is not installed: the packages that they name offer it."""

import pytest
import typer

from anysim import hooks, registry


@pytest.mark.parametrize(("kind", "name"), [key for key in registry.INSTALL_HINTS if key[0] != "commands"])
def test_the_package_of_a_hint_offers_it(kind: str, name: str) -> None:
    assert registry.distribution(kind, name) == registry.INSTALL_HINTS[kind, name]


def test_the_commands_of_hints_are_those_that_plugins_add() -> None:
    app = typer.Typer()
    hooks.add_commands(app)
    added = {command.name for command in app.registered_commands} | {group.name for group in app.registered_groups}
    assert added == {name for kind, name in registry.INSTALL_HINTS if kind == "commands"}
