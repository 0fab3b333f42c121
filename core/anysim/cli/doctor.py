"""`anysim doctor`: what works on this machine, and the remedy for what does not."""

import typer

from anysim.cli.options import AsJson

STYLES = {
    "ok": "green", "note": "dim", "absent": "dim", "missing": "yellow", "unavailable": "red", "wrong": "bold red",
    "broken": "bold red",
}  # fmt: skip


def doctor(json: AsJson = False) -> None:
    """Check the machine and every installed engine: version, import, physics, rendering, threads.

    Each fault comes with its remedy. Engines are tried in processes of their own: one that is missing, crashes or hangs
    costs nothing but its own rows. Exit code 1 if no engine with dynamics works.
    """
    from anysim import registry
    from anysim.cli.machine import machine
    from anysim.cli.output import print_json, print_table, working_on
    from anysim.engine.doctor import Finding, Health, examine

    rows = machine()
    works = False
    for name in registry.names("engines"):
        with working_on(f"trying {name}"):
            found = examine(name)
        rows += found.findings
        works |= found.works
    rows += [
        Finding(f"{kind.removesuffix('s')}: {name}", Health.MISSING, "not installed", f"pip install {package}")
        for (kind, name), package in sorted(registry.INSTALL_HINTS.items())
        if name not in registry.names(kind)
    ]
    if json:
        print_json([row._asdict() for row in rows])
    else:
        print_table("anysim doctor", Finding._fields, rows, STYLES)
    if not works:
        raise typer.Exit(1)
