"""`anysim doctor`: what works on this machine, and the remedy for what does not."""

from typing import Any

import typer

from anysim.cli.options import AsJson


def doctor(json: AsJson = False) -> None:
    """Check the machine and every installed engine: version, import, physics, rendering; each fault with its remedy.

    An engine that is missing or broken costs nothing but its own rows. Exit code 1 if no engine with dynamics works.
    """
    from anysim import registry
    from anysim.cli.output import print_json, print_table

    rows = _machine()
    working = False
    for name in registry.names("engines"):
        found, usable = _engine(name)
        rows += found
        working |= usable
    for name, package in sorted(registry.INSTALL_HINTS.items()):
        if name[1] not in registry.names(name[0]):
            rows.append(_row(f"{name[0]}: {name[1]}", "missing", "not installed", f"pip install {package}"))
    if json:
        print_json(rows)
    else:
        print_table("anysim doctor", ("what", "state", "found", "remedy"), [tuple(r.values()) for r in rows])
    if not working:
        raise typer.Exit(1)


def _row(what: str, state: str, found: str, remedy: str = "") -> dict[str, str]:
    return {"what": what, "state": state, "found": found, "remedy": remedy}


def _machine() -> list[dict[str, str]]:
    import os
    import platform

    from anysim import __version__
    from anysim.world.cache import cache_folder

    rows = [
        _row("anysim", "ok", __version__),
        _row("python", "ok", f"{platform.python_version()} on {platform.system()} {platform.machine()}"),
        _row("processors", "ok", str(os.cpu_count())),
    ]
    folder = cache_folder()
    nearest = next((p for p in (folder, *folder.parents) if p.exists()), folder)
    writable = os.access(nearest, os.W_OK)
    remedy = "" if writable else "set ANYSIM_CACHE_DIR to a directory you can write to"
    rows.append(_row("cache", "ok" if writable else "read-only", str(folder), remedy))
    return rows


def _engine(name: str) -> tuple[list[dict[str, str]], bool]:
    """The rows of one engine, and whether it steps a world with dynamics."""
    from anysim import registry
    from anysim.engine.capability import Capability
    from anysim.errors import AnysimError

    try:
        engine_class = registry.load("engines", name)
        here = engine_class.availability()
    except AnysimError as error:
        return [_row(f"engine: {name}", "broken", str(error), "reinstall the package it comes from")], False
    if not here.available:
        return [_row(f"engine: {name}", "unavailable", "; ".join(here.missing), here.remedy)], False
    rows = [_row(f"engine: {name}", "ok", here.version)]
    try:
        fell, picture = _try(engine_class)
    except Exception as error:  # noqa: BLE001  whatever an engine does here belongs into its row
        return [*rows, _row(f"{name}: physics", "broken", f"{type(error).__name__}: {error}", here.remedy)], False
    dynamic = Capability.DYNAMICS in engine_class.capabilities
    ok = fell or not dynamic
    rows.append(_row(f"{name}: physics", "ok" if ok else "wrong", "a ball falls" if fell else "a ball does not fall"))
    rows.append(picture)
    return rows, ok and dynamic


def _try(engine_class: Any) -> tuple[bool, dict[str, str]]:
    from anysim.engine.capability import Capability
    from anysim.errors import AnysimError
    from anysim.world.model import Body, BodyKind, Entity, EntityKind, Geom, Inertial, Sphere, World

    inertial = Inertial(1.0, inertia=(0.004, 0.004, 0.004, 0.0, 0.0, 0.0))
    ball = World(
        "ball", bodies=(Body("ball", BodyKind.FREE, position=(0.0, 0.0, 1.0), inertial=inertial),),
        geoms=(Geom("ball", 0, Sphere(0.1), collides=False),),
        entities=(Entity("ball", EntityKind.OBJECT, 0, 1, 0, 0),),
    )  # fmt: skip
    what = f"{engine_class.name}: rendering"
    with engine_class() as engine:
        engine.create_world(ball)
        engine.step(50)
        fell = bool(engine.get_state().body_pose[0, 0, 2] < 1.0)
        if Capability.RENDER_RGB not in engine.capabilities:
            return fell, _row(what, "absent", "this engine does not draw")
        try:
            engine.render(width=64, height=64)
            return fell, _row(what, "ok", engine.renderer_name())
        except AnysimError as error:
            return fell, _row(what, "broken", str(error))
