"""`anysim robot`: what a robot of the catalogue is, whether it holds what it says, and a draft of a new one."""

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from anysim.cli.options import AsJson


class _ShowsByDefault(TyperGroup):
    """`anysim robot NAME` is `anysim robot show NAME`."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that is named, else `show` with all words as they are."""
        if args and not args[0].startswith("-") and args[0] not in self.commands:
            args = ["show", *args]
        return super().resolve_command(ctx, args)


app = typer.Typer(
    cls=_ShowsByDefault,
    no_args_is_help=True,
    help="""What a robot is (`anysim robot NAME`), and a draft of a new one (`anysim robot import FILE`).

    Examples:
      anysim robot franka_panda
      anysim robot franka_panda --check --engine all
      anysim robot import my_arm.urdf --out my_arm.yaml
    """,
    subcommand_metavar="NAME|import",
)

Checked = Annotated[bool, typer.Option("--check", help="Qualify it: kinematics, holding, random actions, replay.")]


@app.command("show")
def show(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="As in `anysim list robots`, or the YAML file of an entry.")
    ],
    picture: Annotated[
        Path | None, typer.Option("--picture", help="Write a PNG of it, as each engine draws it, side by side.")
    ] = None,
    check: Checked = False,
    engine: Annotated[
        str | None,
        typer.Option(
            "--engine", "-e", help="Engines, separated by commas, or `all` (default all) for checks and picture."
        ),
    ] = None,
    hold: Annotated[float, typer.Option(min=0.02, help="Simulated time that it has to hold still [s].")] = 5.0,
    random: Annotated[float, typer.Option(min=0.02, help="Simulated time of random actions [s].")] = 10.0,
    json: AsJson = False,
) -> None:
    """Show a robot: joints with limits, gains and channels, tools, sensors, licence.

    With --check it is qualified on the engines, which takes about ten seconds each: the world is built and read back,
    link frames are compared with another loader of its file, its default controllers have to hold the home position and
    to bear random actions, and the same actions again must give the same bytes. Exit code 1 if a check fails.

    Examples:
      anysim robot franka_panda
      anysim robot franka_panda --picture panda.png --engine mujoco
      anysim robot my_arm.yaml --check --engine all --hold 1
    """
    from anysim.assets.catalogue import load_robot
    from anysim.cli.output import print_json
    from anysim_robots.cli.robot_tables import document, tell, tell_checks
    from anysim_robots.cli.robot_work import draw, qualified
    from anysim_robots.qualify.result import as_data
    from anysim_robots.qualify.run import Durations

    entry = load_robot(name)
    shown = document(entry)
    found = qualified(name, _engines(engine), Durations(hold, random), quiet=json) if check else []
    if picture is not None:
        shown["picture"] = draw(entry, _engines(engine), picture)
    if json:
        print_json(shown | ({"checks": [as_data(one) for one in found]} if check else {}))
    else:
        tell(shown)
        tell_checks(found)
    if any(one.status in ("failed", "refused") for one in found):
        raise typer.Exit(1)


def _engines(text: str | None) -> list[str]:
    from anysim_robots.qualify.stage import engines

    if text is None or text == "all":
        return engines()
    return [part.strip() for part in text.split(",") if part.strip()]


def _packages(given: list[str]) -> dict[str, Path]:
    """Folders by name, of `NAME=FOLDER`."""
    from anysim.errors import AnysimError

    found: dict[str, Path] = {}
    for words in given:
        name, _, folder = words.partition("=")
        if not name or not folder:
            raise AnysimError(f"--package {words}: expected NAME=FOLDER, such as my_meshes=../my_meshes")
        if name in found:
            raise AnysimError(f"--package {words}: {name} is {found[name]} already; give each package once")
        if not Path(folder).is_dir():
            raise AnysimError(f"--package {words}: there is no folder {folder}; it is the one with what follows NAME/")
        found[name] = Path(folder)
    return found


def _arguments(given: list[str]) -> dict[str, str]:
    """Values by name, of `NAME:=VALUE`."""
    from anysim.errors import AnysimError

    found: dict[str, str] = {}
    for words in given:
        name, marker, value = words.partition(":=")
        if not name or not marker or name in found:
            raise AnysimError(f"--arg {words}: expected NAME:=VALUE, each name once, such as hand:=true")
        found[name] = value
    return found


@app.command("import")
def import_(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE|FOLDER|URI|NAME",
            help="A URDF, xacro, SDF or MJCF file, FILE.xml#BODY for one of several bodies; a folder with one; a URI, "
            "as package:NAME/FILE; or a name of robot_descriptions, as panda_description.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option("--out", help="The YAML file to write; default NAME.yaml in this folder.")
    ] = None,
    name: Annotated[
        str | None, typer.Option("--name", help="Its name in the catalogue; default that of the file.")
    ] = None,
    package: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=FOLDER", help="Where the package is that a URDF calls package://NAME/…; may be given again."
        ),
    ] = None,
    arg: Annotated[
        list[str] | None,
        typer.Option("--arg", metavar="NAME:=VALUE", help="An argument of a xacro file; may be given again."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is there.")] = False,
    engine: Annotated[
        str | None,
        typer.Option(
            "--engine", "-e", help="Engines to try it on, separated by commas, or `all` (default), or `none`."
        ),
    ] = None,
    hold: Annotated[float, typer.Option(min=0.02, help="Simulated time that it has to hold still [s].")] = 2.0,
    json: AsJson = False,
) -> None:
    """Write a draft of a catalogue entry for a model file, and try it on the engines.

    Base, channels, tools, legs and gains are guessed from names, the tree and the inertias, each with its reason; what
    could not be inferred stands in the draft as comments that begin with TODO, above all the licence. Then it is built
    on each engine, each in a process of its own, read back, held against another loader of its file, and has to hold
    its home position. Exit code 1 if a check fails on an engine, which the table names: the draft is written all the
    same. Look at it with `anysim robot DRAFT.yaml --picture draft.png`; `--check` adds random actions.

    Examples:
      anysim robot import my_arm.urdf
      anysim robot import robot.xml --out my_robot.yaml --name my_robot
      anysim robot import my_arm.urdf --package my_meshes=../my_meshes
      anysim robot import my_arm.urdf.xacro --arg hand:=true
      anysim robot import package:my_robots/arm/arm.urdf --engine mujoco
    """
    from anysim.cli.output import print_json
    from anysim.errors import AnysimError
    from anysim_robots.cli.robot_tables import tell_tried
    from anysim_robots.cli.robot_work import qualified
    from anysim_robots.drafting.draft import draft
    from anysim_robots.qualify.result import as_data
    from anysim_robots.qualify.run import Durations

    made = draft(file, name, _packages(package or []), _arguments(arg or []))
    target = out or Path(f"{made.name}.yaml")  # never beside the model: that is somebody else's folder
    if target.exists() and not force:
        raise AnysimError(f"there is a file {target} already; give another --out, or --force to replace it")
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(made.text(target.parent), encoding="utf-8")
    engines = [] if engine == "none" else _engines(engine)
    tried = qualified(str(target), engines, Durations(hold, 0.0), quiet=json)
    if json:
        print_json(
            {
                "file": str(target),
                "guessed": made.guess.reasons,
                "open": made.open,
                "notes": made.notes,
                "engines": {one.engine: as_data(one) for one in tried},
            }
        )
    else:
        typer.echo(str(target))
        for kind, lines in (("importer:", made.notes), ("guessed", made.guess.reasons), ("TODO", made.open)):
            for words in lines:
                typer.echo(f"  {kind} {words}")
        tell_tried(tried)
    if any(one.status != "qualified" for one in tried):
        raise typer.Exit(1)
