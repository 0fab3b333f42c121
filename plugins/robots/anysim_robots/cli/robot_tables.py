"""Tables that `anysim robot NAME` prints."""

from collections.abc import Sequence
from math import isinf
from typing import TYPE_CHECKING, Any

import typer

from anysim.cli.output import print_table

if TYPE_CHECKING:
    from anysim.assets.catalogue import CatalogueEntry
    from anysim_robots.qualify.result import Qualification


def document(entry: "CatalogueEntry") -> dict[str, Any]:
    """Everything about a robot as plain data; joints only where its files are installed."""
    from anysim.assets.catalogue import missing_source

    spec = entry.spec
    absent = missing_source(entry)
    shown: dict[str, Any] = {
        "name": spec.name, "description": spec.description, "category": spec.category, "base": spec.base,
        "source": spec.source, "license": spec.license, "license_source": spec.license_source,
        "parts": [part.source for part in spec.parts], "file": str(entry.file),
        "available": not absent, "remedy": absent,
        "controllers": {name: list(channel.controllers) for name, channel in spec.channels.items()},
        "tools": {name: tool.link for name, tool in spec.tools.items()},
        "sensors": {name: f"{sensor.kind} on {sensor.link}" for name, sensor in spec.sensors.items()},
        "legs": {name: list(leg.joints) for name, leg in spec.legs.items()},
    }  # fmt: skip
    return shown if absent else shown | _built(entry)


def _built(entry: "CatalogueEntry") -> dict[str, Any]:
    """What the world says of it."""
    from anysim.api import load
    from anysim.compile.world import compile_with_report
    from anysim_robots.qualify.stage import NAME, stage
    from anysim_robots.qualify.statics import facts_of

    compiled = compile_with_report(load(stage(entry)).spec)
    world, robot = compiled.world, compiled.world.robots[0]
    channel_of = {joint: name for name, channel in robot.channels.items() for joint in channel.joints}
    drives = {actuator.joint: actuator for actuator in world.actuators}
    joints: list[dict[str, Any]] = []
    for i, joint in enumerate(world.joints):
        drive = drives.get(i)
        leader = None if joint.mimic is None else world.joints[joint.mimic.joint].name.removeprefix(f"{NAME}.")
        joints.append(
            {
                "joint": joint.name.removeprefix(f"{NAME}."),
                "type": str(joint.type),
                "channel": channel_of.get(i, ""),
                "follows": leader,
                "lower": joint.lower,
                "upper": joint.upper,
                "home": joint.initial,
                "velocity_limit": joint.velocity_limit,
                "armature": joint.armature,
                "mode": None if drive is None else str(drive.mode),
                "kp": None if drive is None else drive.kp,
                "kd": None if drive is None else drive.kd,
                "effort_limit": joint.effort_limit if drive is None else drive.effort_limit,
            }
        )
    return {
        **facts_of(world)._asdict(),
        "repaired": [str(note) for note in compiled.report[NAME]],
        "joint_table": joints,
    }


def tell(shown: dict[str, Any]) -> None:
    """The document for people."""
    typer.echo(f"{shown['name']}: {shown['description']}")
    base = "bolted down" if shown["base"] == "fixed" else "free to move"
    typer.echo(f"{shown['category']}, {base}; {shown['license']} ({shown['license_source']})")
    typer.echo(f"from {shown['source']}" + "".join(f" + {part}" for part in shown["parts"]) + f", by {shown['file']}")
    if not shown["available"]:
        typer.echo(f"not available: {shown['remedy']}")
    else:
        followers = f", {shown['followers']} of which follow others" if shown["followers"] else ""
        typer.echo(f"{shown['mass']:.4g} kg, {shown['joints']} joints{followers}, {shown['drives']} driven")
        _tell_joints(shown["joint_table"])
    for name, names in shown["controllers"].items():
        typer.echo(
            f"channel {name}: {', '.join(names) if names else 'no controller of its own; name one in the world'}"
        )
    for kind in ("tools", "sensors"):
        for name, where in shown[kind].items():
            typer.echo(f"{kind[:-1]} {name}: {where}")
    for name, joints in shown["legs"].items():
        typer.echo(f"leg {name}: {', '.join(joints)}")
    for words in shown.get("repaired", ()):
        typer.echo(f"importer: {words}")
    if "picture" in shown:
        typer.echo(str(shown["picture"]))


def _tell_joints(joints: Sequence[dict[str, Any]]) -> None:
    columns = ("joint", "channel", "limits", "home", "max speed", "max effort", "kp", "kd", "armature")
    rows = [
        (
            j["joint"],
            f"follows {j['follows']}" if j["follows"] and not j["channel"] else j["channel"],
            f"{_number(j['lower'])} … {_number(j['upper'])}",
            _number(j["home"]),
            _number(j["velocity_limit"]),
            _number(j["effort_limit"]),
            _number(j["kp"]),
            _number(j["kd"]),
            _number(j["armature"]),
        )
        for j in joints
    ]
    if rows:
        print_table("joints [rad, N m] or [m, N]", columns, rows)


def _number(value: float | None) -> str:
    if value is None:
        return ""
    if isinf(value):
        return "-∞" if value < 0 else "∞"
    return f"{value:.4g}"


def tell_checks(found: "Sequence[Qualification]") -> None:
    """The checks of each engine, a line each."""
    for one in found:
        why = f": {one.why}" if one.why else ""
        typer.echo(f"{one.engine} {one.engine_version}: {one.status}{why}")
        for check in one.checks:
            typer.echo(f"  {check.told}")


def tell_tried(found: "Sequence[Qualification]") -> None:
    """What each engine makes of a draft: a row each, and the reason of what did not pass below."""
    asked = ("build", "source", "audit", "kinematics", "hold")
    rows: list[tuple[str, ...]] = []
    for one in found:
        checks = {check.name: check for check in one.checks}
        cells = [_WORDS[checks[name].passed] if name in checks else "not reached" for name in asked]
        rows.append((f"{one.engine} {one.engine_version}", one.status, *cells))
    if rows:
        print_table("the draft on each engine", ("engine", "", *asked), rows, {"no": "red", "failed": "red"})
    for one in found:
        if one.why:
            typer.echo(f"  {one.engine}: {one.why}")
        for check in one.failed:
            typer.echo(f"  {one.engine}: {check.told}")


_WORDS = {True: "yes", False: "no", None: "not asked"}
