"""`anysim list`: what is installed."""

import os
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated

import typer

from anysim.cli.options import AsJson

if TYPE_CHECKING:
    from anysim.conventions import Array
    from anysim_schemas.load import LoadedRun


def list_(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="KIND", help="engines, tasks, robots, terms, skills, planners…; an unknown word names all kinds."
        ),
    ],
    engines: Annotated[
        bool, typer.Option(help="Of tasks: which engines can run them, which takes a moment where it is not known yet.")
    ] = True,
    json: AsJson = False,
) -> None:
    """List what is installed of a kind, and where it comes from.

    Examples:
      anysim list tasks --engines
    """
    from anysim import registry
    from anysim.cli.output import print_json, print_table
    from anysim.errors import PluginError, listing, suggest

    if kind not in registry.KINDS:
        raise PluginError(
            f"there is no kind '{kind}'{suggest(kind, list(registry.KINDS))} (kinds: {listing(registry.KINDS, 30)})"
        )
    if kind == "robots":
        _robots(json)
        return
    if kind == "tasks":
        _tasks(engines, json)
        return
    rows = [{"name": name, "from": _origin(kind, name), "what": _what(kind, name)} for name in registry.names(kind)]
    if json:
        print_json(rows)
        return
    print_table(f"{kind}: {registry.KINDS[kind]}", ("name", "from", "what"), [tuple(r.values()) for r in rows])
    if kind == "engines":
        _capabilities()


def _robots(json: bool) -> None:
    """The catalogue: what each robot is, how many joints are commanded, and whether its files are here."""
    from anysim import registry
    from anysim.assets.catalogue import load_robot, missing_source
    from anysim.cli.output import print_json, print_table
    from anysim.errors import AnysimError

    rows: list[dict[str, object]] = []
    for name in registry.names("robots"):
        row: dict[str, object] = {"name": name, "from": _origin("robots", name)}
        try:
            entry = load_robot(name)
        except AnysimError as error:
            rows.append({**row, "what": f"does not load: {error}", "available": False})
            continue
        spec, absent = entry.spec, missing_source(entry)
        commanded = sum(len(channel.joints) for channel in spec.channels.values())
        row |= {"category": spec.category, "dof": commanded, "source": spec.source, "license": spec.license}
        row |= {"available": not absent, "remedy": absent}
        rows.append({**row, "what": f"{spec.category}: {spec.description} ({spec.license})"})
    if json:
        print_json(rows)
        return
    columns = ("name", "category", "dof", "license", "available", "source", "from")
    told = [[r.get(c) for c in columns] for r in rows]
    for line, row in zip(told, rows, strict=True):
        line[4] = "yes" if row["available"] else row.get("remedy") or row["what"]
    print_table("robots: dof counts the joints that are commanded; see `anysim robot NAME`", columns, told)


def _tasks(ask_engines: bool, json: bool) -> None:
    """The catalogue of tasks; the family of one is the folder that its own is in."""
    from anysim import registry
    from anysim.api import load, task_path
    from anysim.cli.output import print_json, print_table
    from anysim.errors import AnysimError, PluginError

    rows: list[dict[str, object]] = []
    for name in registry.names("tasks"):
        row: dict[str, object] = {"name": name, "from": _origin("tasks", name)}
        rows.append(row)
        try:
            path = task_path(name)
            loaded = load(path)
            spec, task = loaded.spec, loaded.spec.task
            if task is None:
                raise PluginError(f"its file {path} has no task")
            expert = task.expert.skill if task.expert else "commands" if spec.collect and spec.collect.commands else ""
            row |= {"family": path.parent.parent.name, "horizon": task.horizon, "expert": expert}
            row |= {"robots": [one.robot for one in spec.world.robots.values()], "levels": list(spec.levels)}
            row |= {"alternates": list(spec.alternates)}
            row |= {"what": task.description}
            if (picture := path.with_name("picture.jpg")).exists():
                row["picture"] = os.path.relpath(picture)
            if ask_engines:
                row["engines"] = _able(loaded, name)
        except AnysimError as error:
            row["what"] = f"does not load: {error}"
    if json:
        print_json(rows)
        return
    columns = (
        "name",
        "family",
        "robots",
        "alternates",
        "horizon",
        "levels",
        *(["engines"] if ask_engines else []),
        "expert",
    )
    told = [
        [", ".join(map(str, v)) if isinstance(v := row.get(c, ""), list) else v for c in (*columns, "from", "what")]
        for row in rows
    ]
    print_table("tasks: `anysim run NAME` collects with the expert", (*columns, "from", "what"), told)


def _able(loaded: "LoadedRun", name: str) -> list[str]:
    """The engines with physics that can run a task; asked again where the task, its robots or an engine changed."""
    import numpy as np

    from anysim import __version__, cache
    from anysim.api import check_engine, compile_world
    from anysim.assets.catalogue import load_robot
    from anysim.engine.capability import Capability
    from anysim.engine.factory import availability, engine_class, runnable
    from anysim.errors import CapabilityError

    engines = runnable(Capability.DYNAMICS)

    def ask() -> dict[str, "Array"]:
        world, able = compile_world(loaded), list[str]()
        for engine in engines:
            with suppress(CapabilityError):
                check_engine(loaded, world, engine_class(engine), name)
                able.append(engine)
        return {"engines": np.array(able, dtype=str)}

    robots = [repr(load_robot(robot.robot)) for robot in loaded.spec.world.robots.values()]
    each = [f"{engine} {availability(engine).version} {engine_class(engine).capabilities!r}" for engine in engines]
    key = cache.digest(__version__, repr(loaded.spec.to_dict()), *robots, *each)
    return cache.load_or_make("task_engines", key, ask)["engines"].tolist()


def _capabilities() -> None:
    """What each engine that loads can do, with the measured error of what is approximate."""
    from anysim import registry
    from anysim.cli.output import print_table
    from anysim.engine.capability import matrix
    from anysim.engine.factory import engine_class
    from anysim.errors import PluginError

    declared, lifecycles = {}, {}
    for name in registry.names("engines"):
        try:
            with registry.using("engines", name):
                found = engine_class(name)
                declared[name], lifecycles[name] = found.capabilities, found.lifecycle.words
        except PluginError:
            continue  # its row above says why
    engines, rows, notes = matrix(declared, lifecycles)
    typer.echo()
    print_table("capabilities", ("capability", *engines), rows)
    for number, note in enumerate(notes, 1):
        typer.echo(f"[{number}] {note}")


def _origin(kind: str, name: str) -> str:
    from anysim import registry
    from anysim.errors import PluginError

    try:
        return registry.distribution(kind, name)
    except PluginError as error:
        return f"ambiguous: {error}"


def _what(kind: str, name: str) -> str:
    """One line about a plugin; a plugin that does not load says so here and hurts nothing else."""
    from anysim import registry
    from anysim.errors import AnysimError

    try:
        with registry.using(kind, name):
            return _line(kind, name)
    except AnysimError as error:
        return f"does not load: {error}"


def _line(kind: str, name: str) -> str:
    from anysim import registry

    if kind == "engines":
        from anysim.engine.factory import availability

        here = availability(name)
        return here.version if here.available else f"not available: {'; '.join(here.missing)}. {here.remedy}"
    if kind == "terms":
        from anysim.task.term_registry import term_names

        return ", ".join(term_names(name))
    doc = registry.load(kind, name).__doc__
    return doc.strip().splitlines()[0] if isinstance(doc, str) and doc.strip() else ""
