"""`anysim view`, and `anysim bench view`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from anysim.cli.options import AsJson, Engine, NumEnvs, Overrides, Robot, Seed, with_robot

if TYPE_CHECKING:
    from anysim.task.env import TaskEnv
    from anysim_viewer.gate import Access
    from anysim_viewer.page import Page
    from anysim_viewer.view import View


def view(
    source: Annotated[
        str,
        typer.Argument(
            metavar="TASK|WORLD|RUN", help="An installed task, a YAML file, or the directory of a run or trajectory."
        ),
    ],
    engine: Engine = None,
    num_envs: NumEnvs = None,
    seed: Seed = None,
    robot: Robot = None,
    override: Overrides = None,
    policy: Annotated[
        str | None,
        typer.Option(help="Who acts at first: expert, random, FILE.onnx…, as of `anysim evaluate`. Default: nobody."),
    ] = None,
    play: Annotated[bool, typer.Option("--play", help="Have time go on at once.")] = False,
    host: Annotated[str, typer.Option(help="The address to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="The port; 0 is any that is free.")] = 8480,
    no_token: Annotated[
        bool, typer.Option("--no-token", help="Let every process of this machine in; on loopback only.")
    ] = False,
    allow_host: Annotated[
        list[str] | None, typer.Option(help="Another name under which it may be asked. May be repeated.")
    ] = None,
    tls_certificate: Annotated[Path | None, typer.Option(help="A PEM file: serve https with it.")] = None,
    tls_key: Annotated[Path | None, typer.Option(help="Its key, where that is in a file of its own.")] = None,
    open_browser: Annotated[bool, typer.Option("--open", help="Open the page in a browser.")] = False,
    base: Annotated[
        Path | None, typer.Option(help="Folder that relative paths of a recording's assets are relative to.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Directory of the videos that are made in the page.")] = Path("runs/views"),
) -> None:
    """Show a task, a world or a recording in a browser, on any engine, from the neutral model.

    Of a task or a world: play, pause, one step, reset with a seed, who acts, drag goals and objects, cameras, contacts,
    plots, videos. Of a run: the same to be looked at, and a slider through each episode. The address that is printed
    carries a token; who has it may look and drive. Ctrl-C ends it.

    Examples:
      anysim view pick_cube --policy expert --play
      anysim view pick_cube -e sapien --num-envs 4 --open
      anysim view warehouse.yaml
      anysim view runs/pick_cube-mujoco-seed0-1b2c3d4e
    """
    from anysim_viewer.gate import Access, fresh_token

    token = "" if no_token else fresh_token()
    access = Access(host, port, token, tuple(allow_host or ()), tls_certificate, tls_key)
    place = Path(source)
    if place.is_dir():
        if num_envs is not None or seed is not None or policy is not None or robot is not None:
            raise _only("--num-envs, --seed, --robot and --policy", "tasks and worlds", source)
        _show_run(place, engine, override or [], base, access, play, out, open_browser)
        return
    _refuse_nothing(source, place)
    from anysim.api import load, make, watched

    changes = [*with_robot(override, robot), *([] if engine is None else [f"engine={engine}"])]
    loaded = watched(load(source, overrides=changes))
    name = source if "/" not in source and place.suffix not in (".yaml", ".yml") else place.stem
    with make(loaded, num_envs=num_envs) as env:
        env.name = name
        first = env.spec.seed if seed is None else seed
        _show_env(env, first, policy, access, play, out, open_browser)


def bench(
    task: Annotated[str, typer.Argument(metavar="TASK", help="An installed task or a YAML file.")] = "pick_cube",
    engine: Engine = None,
    num_envs: NumEnvs = None,
    steps: Annotated[int, typer.Option(min=10, help="Control steps of each measurement.")] = 400,
    rounds: Annotated[int, typer.Option(min=1, help="Measurements of each kind, in turn; the medians count.")] = 5,
    json: AsJson = False,
) -> None:
    """What a view costs the loop that it looks at: processor time of the stepping thread, with a client and without.

    The client is a process of its own that takes what a browser would. `paced` steps are those of a loop that keeps to
    real time; others follow each other as fast as they can.

    Examples:
      anysim bench view pick_cube -e pybullet --num-envs 4
    """
    from anysim.cli.output import print_json, print_table
    from anysim_viewer.bench import cost

    found = cost(task, engine, num_envs or 1, steps, rounds)
    if json:
        print_json([one._asdict() for one in found])
        return
    heads = ("loop", "envs", "alone [us/step]", "viewed", "a moment [us]", "share at 20 Hz", "all threads [us/step]")
    rows = [
        (
            one.loop,
            str(one.num_envs),
            f"{one.alone:,.0f}",
            f"{one.viewed:,.0f}",
            f"{one.moment:,.0f}",
            f"{one.share:.1%}",
            f"{one.process_alone:,.0f} -> {one.process_viewed:,.0f}",
        )
        for one in found
    ]
    print_table(f"Processor time of the stepping thread, {task} on {found[0].engine}", heads, rows)


def _only(options: str, what: str, source: str) -> Exception:
    from anysim.errors import TaskError

    return TaskError(f"{options} are for {what}, and {source} is the directory of a recording; leave them out")


def _refuse_nothing(source: str, place: Path) -> None:
    """A path that leads nowhere is told as one: it may have been meant as a run."""
    from anysim.errors import TaskError

    if ("/" in source or place.suffix in (".yaml", ".yml")) and not place.is_file():
        raise TaskError(
            f"there is nothing at {source}; expected an installed task (`anysim list tasks`), a YAML file, or the "
            "directory of a run"
        )


def _show_env(
    env: "TaskEnv", seed: int, policy: str | None, access: "Access", play: bool, out: Path, open_browser: bool
) -> None:
    from anysim_viewer.live import LiveView
    from anysim_viewer.page import Page

    page = Page(access, f"anysim: {env.name}")
    try:
        shown = LiveView(page, env, seed, policy=policy, play=play, out=out)
        try:
            engine = f"{env.engine.name} {env.engine.version}"
            _run(page, shown, access, f"viewing {env.name} on {engine}, seed {seed}", open_browser)
        finally:
            shown.close()
    finally:
        page.close()


def _show_run(
    place: Path,
    engine: str | None,
    overrides: list[str],
    base: Path | None,
    access: "Access",
    play: bool,
    out: Path,
    open_browser: bool,
) -> None:
    from anysim.record.names import find_trajectories
    from anysim_film.stage import FilmOrder
    from anysim_viewer.page import Page
    from anysim_viewer.playback import Playback

    trajectories = find_trajectories([place])
    order = FilmOrder(engine=engine, overrides=tuple(overrides), base=base)
    page = Page(access, f"anysim: {place.name}")
    try:
        shown = Playback(page, trajectories, order, play=play, out=out)
        try:
            _run(page, shown, access, f"viewing {len(trajectories)} recorded episodes of {place}", open_browser)
        finally:
            shown.close()
    finally:
        page.close()


def _run(page: "Page", shown: "View", access: "Access", what: str, open_browser: bool) -> None:
    """Tell where it is, and go on until SIGINT or SIGTERM."""
    import signal
    import threading
    import webbrowser

    stop = threading.Event()

    def end(*_: object) -> None:
        stop.set()
        page.ask(lambda: None)  # wakes the loop

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        typer.echo(f"{what}: {page.url}")
        if not access.token:
            typer.echo(
                "warning: there is no token: every process and user of this machine can look and drive", err=True
            )
        if not access.on_loopback and access.certificate is None:
            typer.echo("warning: without TLS the token and all data can be read on the network between", err=True)
        typer.echo("Ctrl-C ends it")
        if open_browser:
            webbrowser.open(page.url)
        shown.run(stop)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    typer.echo("ended")
