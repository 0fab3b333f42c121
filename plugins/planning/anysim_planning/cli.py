"""`anysim retarget`: the motion of a recorded tool, as another robot's arm makes it."""

from pathlib import Path
from typing import Annotated, Any

import typer

from anysim.cli.options import AsJson


def retarget(
    recording: Annotated[Path, typer.Argument(metavar="DIR", help="A trajectory, as `anysim run` writes it.")],
    robot: Annotated[str, typer.Option("--robot", "-r", help="Who is to make the motion, as in `anysim list robots`.")],
    tool: Annotated[str | None, typer.Option(help="Its tool; default: its only one.")] = None,
    of: Annotated[str | None, typer.Option(help="ROBOT.TOOL of the recording; default: the only one.")] = None,
    shift: Annotated[
        tuple[float, float, float], typer.Option(help="Moves the motion in the frame of the robot's base [m].")
    ] = (0.0, 0.0, 0.0),
    within: Annotated[
        str | None,
        typer.Option(help="A task or a world file in which the robot stands, by its name there; default: it alone."),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of the postures that it may begin in.")] = 0,
    play: Annotated[
        str | None,
        typer.Option(metavar="ENGINE", help="Let the arm make the motion on this engine, by its own drives."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="A file .npz for times, joint positions and errors.")] = None,
    json: AsJson = False,
) -> None:
    """Carry the motion of a recorded tool to another robot, seen from its base; with --play, simulate it there.

    Exit code 1 says that a part of the motion is out of reach, or that the robot touches itself or what stands around
    it; things that lie loose, as what it grasps, may be touched. Played, it says too that the tool was more than 5 mm
    off the recorded path.

    Examples:
      anysim run pick_cube -k 1 --out runs/a && anysim retarget runs/a/episodes/* --robot ur5 --out ur5.npz
      anysim retarget runs/a/episodes/* --robot ur5 --play mujoco
      anysim retarget runs/a/episodes/* --robot dual_ur5 --tool right --shift 0 -0.8 0
      anysim retarget runs/a/episodes/* --robot panda --within stack_cube
    """
    import numpy as np

    from anysim.api import compile_world
    from anysim.cli.output import print_json
    from anysim.conventions import IDENTITY_QUATERNION
    from anysim.math import pose as P
    from anysim.record.reader import open_trajectory
    from anysim_planning import playing, retarget as motions

    reader = open_trajectory(recording)
    source = compile_world(reader.manifest.spec)
    first, its_tool = motions.only_tool(source, *(of.partition(".")[::2] if of else (None, None)))
    done = motions.tool_motion(reader, source, first, its_tool)
    alone = {"world": {"terrain": "none", "robots": {robot: {"robot": robot}}}}
    world = compile_world(alone if within is None else within)
    its = motions.only_tool(world, robot, tool)
    arm = motions.arm_of(world, *its)
    base = world.initial_body_pose[arm.root]
    wanted = motions.carried(done.poses, done.base, base, P.pose(shift, IDENTITY_QUATERNION))
    around = motions.Surroundings(world, arm)
    made = motions.retarget(arm, base, done.times, wanted, seed=seed, around=around)
    bad = None if made.free.all() else int(np.argmin(made.free))
    touch = None if bad is None else (float(made.times[bad]), *around.touching(made.joint_pos[bad]))
    found: dict[str, Any] = {
        "rows": len(made.times),
        "reached": int(made.reached.sum()),
        "position_error_m": float(made.position_error.max()),
        "rotation_error_rad": float(made.rotation_error.max()),
        "slowed_by": float(np.ptp(made.times) / max(np.ptp(done.times), 1e-9)),
        "free": int(made.free.sum()),
        "first_touch": None if touch is None else dict(zip(("time", "a", "b"), touch, strict=True)),
        "out": None if out is None else str(out),
    }
    arrays, strays = {"joints": np.array(arm.joint_names), **made._asdict()}, None
    if play is not None:
        played = playing.play(world, *its, made.times, made.joint_pos, play)
        strays = played.strays(made.times, wanted)
        found["played"] = {"engine": played.engine, "position_error_m": strays[0], "rotation_error_rad": strays[1]}
        arrays |= {f"played_{name}": getattr(played, name) for name in ("times", "joint_pos", "tool_pose")}
    if out is not None:
        with out.open("wb") as file:
            np.savez(file, **arrays)
    if json:
        print_json(found)
    else:
        typer.echo(
            f"{found['reached']} of {found['rows']} rows reached by {arm.name}, at most "
            f"{found['position_error_m'] * 1e3:.3g} mm and {found['rotation_error_rad']:.3g} rad off, "
            f"slowed by {found['slowed_by']:.3g}" + (f" -> {out}" if out else "")
        )
        if touch is not None:
            typer.echo(
                f"{len(made.free) - found['free']} rows are not free: first at {touch[0]:.2f} s '{touch[1]}' touches "
                f"'{touch[2]}'; expected a way past it: move the motion with --shift, or take another --seed"
            )
        if strays is not None:
            typer.echo(f"played on {play}: the tool is at most {strays[0] * 1e3:.3g} mm and {strays[1]:.3g} rad off")
    good = (made.reached & made.free).all() and (strays is None or strays[0] <= playing.FOLLOWED)
    raise typer.Exit(int(not good))
