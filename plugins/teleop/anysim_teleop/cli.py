"""`anysim teleop`: drive a robot by hand, and keep what succeeds."""

from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from anysim.cli.options import Engine, Overrides, Seed, Task

if TYPE_CHECKING:
    from anysim_recording.collector import EpisodeResult


def teleop(
    task: Task,
    engine: Engine = None,
    device: Annotated[
        str, typer.Option("--device", "-d", help="An installed input device (`anysim list devices`).")
    ] = "keyboard",
    device_option: Annotated[
        list[str] | None,
        typer.Option("--device-option", "-D", metavar="KEY=VALUE", help="An option of the device. May be repeated."),
    ] = None,
    robot: Annotated[str | None, typer.Option(help="The robot that is driven; default: all arms, in turn.")] = None,
    episodes: Annotated[int, typer.Option("--episodes", "-k", min=1, help="Episodes to attempt.")] = 1,
    seed: Seed = None,
    speed: Annotated[float, typer.Option(min=0.001, help="The largest speed of the tool [m/s].")] = 0.2,
    turn: Annotated[float, typer.Option(min=0.001, help="Its largest rate [rad/s].")] = 1.0,
    time: Annotated[float, typer.Option(min=0.1, help="Simulated time that an episode may take [s].")] = 120.0,
    camera: Annotated[str | None, typer.Option(help="The camera of a device that shows pictures.")] = None,
    override: Overrides = None,
    out: Annotated[
        Path | None, typer.Option(help="Directory of the trajectories; default runs/<task>-<engine>-teleop-<id>.")
    ] = None,
    min_success: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Exit with 1 if a smaller share succeeds.")
    ] = 0.0,
) -> None:
    """Drive the tool of a robot by hand, and keep the episodes that succeed.

    The device moves the tool; inverse kinematics and the robot's own controllers do the rest, so trajectories are like
    those of `anysim run`, and `anysim replay` and `anysim render` take them. An episode begins with the first key and
    ends when the task is solved or has failed, its time is up, or a key ends it; one that does not succeed is kept with
    -o record.keep=all only. Reset begins it anew, discard goes on with the next, and neither leaves anything. The same
    command again goes on with the episodes that are missing.

    Devices:
      keyboard  in this terminal
      browser   a page on this machine: picture, keys, gamepads; -D port=8080
      script    timed commands of a file, not in real time; -D file=pick.yaml

    Keys, which ? shows again:
      w/s a/d r/f    move along x, y, z (so do arrows and page keys)    space  open or close the gripper
      u/o i/k j/l    turn about x, y, z                                 t      axes of the base or of the tool
      + -            faster, slower                                     tab    the next arm
      enter          start the clock; later: end the episode            q      quit
      backspace      begin the same episode again                       x      discard it, go on with the next

    Examples:
      anysim teleop pick_cube -e sapien -d browser --camera front
      anysim teleop pick_cube --episodes 10 --seed 3
      anysim teleop handover --robot partner --speed 0.1 -o record.cameras=[]
      anysim teleop pick_cube -d script -D file=pick.yaml --out runs/scripted && anysim replay runs/scripted
    """
    from anysim.api import load, make
    from anysim.record.commit import file_at, no_directory
    from anysim.record.names import run_name
    from anysim_teleop.devices import make_device
    from anysim_teleop.session import Session, Setup

    if out is not None and (file := file_at(out)) is not None:
        raise no_directory("--out", file)
    made = make_device(device, device_option or ())
    step = load(task, overrides=[*([f"engine={engine}"] if engine else []), *(override or ())]).spec.physics.control_dt
    limits = [f"task.horizon={ceil(time / step)}", *(override or ())]
    results: list[EpisodeResult] = []
    with make(task, engine=engine, num_envs=1, overrides=limits) as env:
        seed = env.spec.seed if seed is None else seed
        directory = out or Path("runs") / run_name(f"{env.name}-teleop", env.engine.name, env.spec.to_dict(), seed)
        typer.echo(
            f"{env.name} on {env.engine.name} {env.engine.version}: {episodes} episodes, seed {seed}, by {device}"
        )
        typer.echo(f"trajectories: {directory}")
        setup = Setup(device, robot, speed, turn, camera)
        with Session(env, made, directory, episodes, seed, setup) as session:
            for result in session.run():
                results.append(result)
    kept = sum(result.path is not None for result in results)
    good = sum(result.success for result in results)
    typer.echo(f"{good} of {len(results)} episodes succeeded; {kept} trajectories in {directory / 'episodes'}")
    if good < min_success * episodes:
        raise typer.Exit(1)
