"""`anysim bench`: what anysim costs."""

from typing import Annotated, Any

import typer

from anysim.cli.options import AsJson

BY_DEFAULT = "default: ANYSIM_ENGINE, else mujoco."

app = typer.Typer(help="Measure what anysim costs, as ratios in one run.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    pass


@app.command("step")
def step(
    engine: Annotated[
        str, typer.Option("--engine", "-e", help="Engines, separated by commas; `all` are those with a raw loop.")
    ] = "all",
    num_envs: Annotated[
        str, typer.Option("--num-envs", "-n", help="Numbers of envs, separated by commas.")
    ] = "1,16,64",
    task: Annotated[str, typer.Option(help="The task of the last rows; an empty name leaves them out.")] = "pick_cube",
    rounds: Annotated[int, typer.Option(min=1, help="Interleaved rounds; the best of each side counts.")] = 7,
    seconds: Annotated[
        float, typer.Option(min=0.0, help="After this long a row ends, once three rounds are done.")
    ] = 5.0,
    world: Annotated[
        str, typer.Option(help="A world file for the first rows, for engines without a Panda's joints or contacts.")
    ] = "",
    json: AsJson = False,
) -> None:
    """Step through SimEngine and through a whole task, each against the engine's own loop doing the same.

    First a Panda with five boxes: commands written and joint positions, velocities, body poses and twists read every
    control step, with the engine's own drives (`native`) and with the drive law (`implicit_pd`); the raw loop has the
    engine's own. Then the task, with observations, rewards and status. All loops write two commands in turn.

    A budget is the least ratio that is good enough; a missed one is marked and changes nothing else.

    Examples:
      anysim bench step
      anysim bench step --engine pybullet --num-envs 16 --task ''
    """
    from collections.abc import Iterator

    from anysim.cli.output import print_json
    from anysim.engine.capability import Capability
    from anysim.engine.factory import engine_class
    from anysim.errors import EngineError
    from anysim.model.world import Actuation
    from anysim_bench.rows import Rows
    from anysim_bench.step import StepCost, engine_cost, engines_of, env_cost

    try:
        sizes = [int(n) for n in num_envs.split(",")]
    except ValueError:
        raise EngineError(f"--num-envs takes whole numbers separated by commas, got '{num_envs}'") from None
    names = engines_of(engine)
    costs: list[StepCost] = []

    def measured(name: str, n: int) -> Iterator[StepCost]:
        native = Capability.ACTUATION_NATIVE in engine_class(name).capabilities
        for mode in (Actuation.NATIVE, Actuation.IMPLICIT_PD) if native else (Actuation.IMPLICIT_PD,):
            yield engine_cost(name, n, rounds, mode, seconds, world)
        if task:
            yield env_cost(name, n, task, rounds, seconds)

    heads = ("engine", "loop", "drives", "envs", "anysim", "raw", "ratio (wall)", "ratio (cpu)", "budget (wall)")
    rows = Rows("Physics steps per second, all envs together", heads, (9, 10, 11, 4, 9, 9), quiet=json)
    for done, (name, n) in enumerate((name, n) for name in names for n in sizes):
        typer.echo(f"measuring {n} envs on {name} ({done + 1} of {len(names) * len(sizes)})…", err=True)
        for c in measured(name, n):
            costs.append(c)
            rows.add(
                c.engine,
                c.what if c.what == "engine" else task,
                c.actuation,
                c.num_envs,
                f"{c.ours:,.0f}",
                f"{c.raw:,.0f}",
                f"{c.ratio:.3f}",
                f"{c.cpu_ratio:.3f}",
                "none" if c.budget is None else f"{c.budget:.2f}" + " missed" * c.missed,
            )
    if json:
        print_json([c._asdict() | {"missed": c.missed} for c in costs])


TASKS = "reach,pick_cube,place_on_pad,stack_cube,push_cube,open_drawer,peg_in_hole,press_button,handover,plug_charger"


@app.command("tasks")
def tasks(
    task: Annotated[str, typer.Option("--tasks", help="Installed tasks, separated by commas.")] = TASKS,
    engine: Annotated[
        str, typer.Option("--engine", "-e", help="Engines, separated by commas; `all` are those with a raw loop.")
    ] = "all",
    num_envs: Annotated[int, typer.Option("--num-envs", "-n", min=1, help="Envs.")] = 16,
    rounds: Annotated[int, typer.Option(min=1, help="Interleaved rounds; the best of each side counts.")] = 5,
    seconds: Annotated[
        float, typer.Option(min=0.0, help="After this long a row ends, once three rounds are done.")
    ] = 4.0,
    json: AsJson = False,
) -> None:
    """Control steps per second of whole tasks: actions, physics, rewards, status and observations, without images.

    Beside them is the engine's own loop over as many physics steps of the same world, in the same run, and the ratio of
    the two. A control step of one env counts as one.

    Examples:
      anysim bench tasks --tasks reach,pick_cube --engine mujoco
    """
    from anysim.api import load
    from anysim.cli.output import print_json
    from anysim_bench.rows import Rows
    from anysim_bench.step import engines_of, env_cost

    chosen = [name.strip() for name in task.split(",")]
    names = engines_of(engine)
    substeps = {name: load(name).spec.physics.substeps for name in chosen}  # unknown names end it before any work
    heads = ("task", "engine", "envs", "control steps/s", "raw loop", "ratio (wall)", "ratio (cpu)")
    rows = Rows("Control steps per second, all envs together", heads, (16, 9), quiet=json)
    found: list[dict[str, Any]] = []
    for done, (name, where) in enumerate((name, where) for name in chosen for where in names):
        typer.echo(f"measuring {name} on {where} ({done + 1} of {len(chosen) * len(names)})…", err=True)
        cost = env_cost(where, num_envs, name, rounds, seconds)
        ours, raw = cost.ours / substeps[name], cost.raw / substeps[name]
        rows.add(name, where, num_envs, f"{ours:,.0f}", f"{raw:,.0f}", f"{cost.ratio:.2f}", f"{cost.cpu_ratio:.2f}")
        said = {"task": name, "engine": where, "num_envs": num_envs, "control_steps_per_second": ours, "raw": raw}
        found.append(said | {"ratio": cost.ratio, "cpu_ratio": cost.cpu_ratio})
    if json:
        print_json(found)


@app.command("shards")
def shards(
    engine: Annotated[str | None, typer.Option("--engine", "-e", help=f"An installed engine; {BY_DEFAULT}")] = None,
    num_envs: Annotated[int, typer.Option("--num-envs", "-n", min=1, help="Envs of all shards together.")] = 16,
    counts: Annotated[str, typer.Option("--shards", help="Numbers of shards, separated by commas.")] = "1,2",
    rounds: Annotated[int, typer.Option(min=1, help="Interleaved rounds; the best of each side counts.")] = 7,
    json: AsJson = False,
) -> None:
    """Step a Panda with five boxes in one process and in several, and compare with the first number of shards.

    Examples:
      anysim bench shards --engine pybullet
    """
    from anysim.cli.output import print_json, print_table
    from anysim.engine.factory import default_engine
    from anysim.errors import EngineError
    from anysim_bench.shards import shard_gains

    try:
        numbers = list(dict.fromkeys(int(n) for n in counts.split(",")))
    except ValueError:
        raise EngineError(f"--shards takes whole numbers separated by commas, got '{counts}'") from None
    name = engine or default_engine()
    gains = shard_gains(name, num_envs, numbers, rounds)
    if json:
        print_json([gain._asdict() for gain in gains])
        return
    print_table(
        f"Physics steps per second on {name}, {num_envs} envs together",
        ("shards", "steps/s", f"ratio to {numbers[0]} (wall)", "ratio (cpu)"),
        [(g.shards, f"{g.rate:,.0f}", f"{g.ratio:.3f}", f"{g.cpu_ratio:.3f}") for g in gains],
    )


@app.command("managers")
def managers(
    engine: Annotated[
        str, typer.Option("--engine", "-e", help="Engines, separated by commas; `all` are those with a raw loop.")
    ] = "all",
    num_envs: Annotated[int, typer.Option("--num-envs", "-n", min=1, help="Envs.")] = 16,
    task: Annotated[str, typer.Option(help="The task.")] = "pick_cube",
    rounds: Annotated[int, typer.Option(min=1, help="Control steps and, a tenth as many, resets.")] = 300,
    json: AsJson = False,
) -> None:
    """What managers, terms and streams cost: their share of a control step, and milliseconds of a reset.

    Each part's own time is told from that of the engine at its calls. The budget of a reset is without the engine: what
    it takes to write a friction, or to build a scene anew, is its own.

    Examples:
      anysim bench managers --engine mujoco
    """
    from anysim.cli.output import print_json, print_table
    from anysim_bench.managers import RESET_BUDGET_MS, STEP_BUDGET, reset_costs, step_costs, task_env
    from anysim_bench.step import engines_of

    names = engines_of(engine)
    steps, resets = [], []
    for name in names:
        typer.echo(f"measuring {num_envs} envs on {name}…", err=True)
        with task_env(name, num_envs, task) as env:
            steps += step_costs(env, rounds)
            resets += reset_costs(env, max(1, rounds // 10))
    if json:
        print_json({"steps": [s._asdict() for s in steps], "resets": [r._asdict() for r in resets]})
        return
    print_table(
        f"A control step of {task} of {num_envs} envs [ms]; budget {STEP_BUDGET:.0%} for what is not the engine's",
        ("engine", "part", "own", "engine at its calls", "share"),
        [(c.engine, c.part, f"{c.own_ms:.3f}", f"{c.engine_ms:.3f}", f"{c.share:.1%}") for c in steps],
    )
    print_table(
        f"A reset of {task} [ms for each env]; budget {RESET_BUDGET_MS:g} for all that is not the engine's",
        ("engine", "part", "own", "engine at its calls"),
        [(c.engine, c.part, f"{c.own_ms:.3f}", f"{c.engine_ms:.3f}") for c in resets],
    )


@app.command("collect")
def collect(
    engine: Annotated[
        str | None, typer.Option("--engine", "-e", help=f"Engines, separated by commas; {BY_DEFAULT}")
    ] = None,
    num_envs: Annotated[int, typer.Option("--num-envs", "-n", min=1, help="Envs.")] = 16,
    episodes: Annotated[int, typer.Option("--episodes", "-k", min=1, help="Episodes, over all envs.")] = 64,
    present: Annotated[
        str, typer.Option(help="Trajectories in the directory before; several numbers are separated by commas.")
    ] = "0",
    cameras: Annotated[bool, typer.Option("--cameras/--no-cameras", help="Record the task's cameras.")] = False,
    task: Annotated[str, typer.Option(help="The task, which has an expert.")] = "pick_cube",
    rounds: Annotated[int, typer.Option(min=1, help="Collections; the one with the median share counts.")] = 3,
    json: AsJson = False,
) -> None:
    """Collect episodes with the task's expert, and see which share of the processor time is the engine's.

    All threads count. Building and a first collection, in which everything is compiled and loaded, do not.

    Examples:
      anysim bench collect --present 0,10000
    """
    from anysim.cli.output import print_json
    from anysim.engine.factory import default_engine
    from anysim.errors import EngineError
    from anysim_bench.collect import ENGINE_SHARE_GOAL, CollectCost, collect_costs, typical
    from anysim_bench.rows import Rows

    try:
        numbers = [int(n) for n in present.split(",")]
    except ValueError:
        raise EngineError(f"--present takes whole numbers separated by commas, got '{present}'") from None
    costs: list[CollectCost] = []
    title = f"Collecting {task}; the goal on MuJoCo, without cameras, is an engine's share of {ENGINE_SHARE_GOAL:.0%}"
    heads = ("engine", "envs", "episodes", "there before", "steps/s", "cpu [s]", "engine's", "recorder's thread")
    rows = Rows(title, heads, (9,), quiet=json)
    for name in (engine or default_engine()).split(","):
        for number in numbers:
            typer.echo(f"collecting {episodes} episodes in {num_envs} envs on {name}…", err=True)
            c = typical(collect_costs(name, num_envs, episodes, number, task, cameras, rounds))
            costs.append(c)
            rows.add(
                c.engine,
                c.num_envs,
                c.episodes,
                c.present,
                f"{c.steps_per_s:,.0f}",
                f"{c.cpu_s:.2f}",
                f"{c.engine_share:.1%}",
                f"{c.record_s / c.cpu_s:.1%}",
            )
    if json:
        print_json([cost._asdict() for cost in costs])


@app.command("plan")
def plan(
    planner: Annotated[str, typer.Option("--planner", "-p", help="The planner of motion.")] = "rrt",
    service: Annotated[
        str, typer.Option("--service", "-s", help="Planner services, separated by commas.")
    ] = "processes,threads",
    requests: Annotated[int, typer.Option("--requests", "-r", min=2, help="Requests, planned together.")] = 50,
    goals: Annotated[int, typer.Option("--goals", "-g", min=1, help="Candidates of each goal set.")] = 16,
    task: Annotated[str, typer.Option(help="The task, whose first robot is an arm.")] = "pick_cube",
    engine: Annotated[
        str | None, typer.Option("--engine", "-e", help=f"The engine that steps meanwhile; {BY_DEFAULT}")
    ] = None,
    pairs: Annotated[int, typer.Option(min=0, help="Plans of two arms together; 0 leaves them out.")] = 200,
    dual: Annotated[str, typer.Option(help="The robot of the catalogue that has these two arms.")] = "baxter",
    json: AsJson = False,
) -> None:
    """Plan motions alone, in services and by roboplan alone, and step 16 envs while requests are in flight.

    All sides plan the same requests in turns; a ratio is that of a service's best turn to the planner's own. Where
    other programs want the cores too, look at the ratio by processor time: worker processes yield to all others.

    The exit code is 1 where shapes touch on a path, looked at by other means than the planner's, where a service gives
    other answers than its planner alone, where not all pairs are solved, and where the default service misses a goal:
    a rate that is too low by both times, or control steps that take longer while it plans.

    Examples:
      anysim bench plan --planner rrt --pairs 20
    """
    from anysim.cli.output import print_json
    from anysim_bench.plan import plan_cost
    from anysim_bench.plan_costs import IK_GOAL, RATIO_GOAL, STALL_GOAL_MS
    from anysim_bench.rows import Rows

    c = plan_cost(planner, task, requests, goals, engine, service.split(","), dual, pairs)
    rows = Rows(
        f"{requests} plans by {planner} for {task}, {goals} candidates each", ("", "is", "goal"), (46, 30), json
    )
    rows.add("solved", f"{c.solved:.0%}", "")
    rows.add("paths that are free at 0.005 rad", f"{c.free:.0%}", "100%")
    rows.add("mean length [rad], mean duration [s]", f"{c.length:.2f}, {c.duration:.2f}", "")
    rows.add("a plan [ms], median and 95th percentile", f"{c.plan_ms:.1f}, {c.plan_p95_ms:.1f}", "")
    rows.add("the first plan [ms]", f"{c.first_ms:.0f}", "")
    rows.add("a planning world for all envs", f"{c.world_ms:.0f} ms, {c.world_mib:.2f} MiB", "")
    rows.add("an env's scene in it", f"{c.scene_ms:.2f} ms, {c.scene_kib:.1f} KiB", "")
    rows.add("plans/s of the planner alone", f"{c.alone:.1f}", "")
    if (b := c.bare) is None:
        rows.add("plans/s of roboplan alone", "not installed", "")
    else:
        rows.add("plans/s of roboplan alone", f"{b.rate:.1f}", "")
        rows.add("roboplan alone: solved, free, mean length", f"{b.solved:.0%}, {b.free:.0%}, {b.length:.2f}", "")
    for one in c.services:
        name = f"{one.service}, workers: {one.workers}"
        rates = f"{one.rate:.1f} ({one.ratio:.2f}, by cpu {one.cpu_ratio:.2f})"
        rows.add(f"{name}: plans/s", rates, f"{RATIO_GOAL:g}")
        if one.bare_ratio is not None and one.bare_cpu_ratio is not None:
            ratios = f"{one.bare_ratio:.2f}, by cpu {one.bare_cpu_ratio:.2f}"
            rows.add(f"{name}: of roboplan alone", ratios, f"{RATIO_GOAL:g}")
        rows.add(f"{name}: start [ms]", f"{one.start_ms:.0f}", "")
        rows.add(f"{name}: the same answers", "yes" if one.same else "no", "yes")
    rows.add("99th percentile of a step [ms]", f"{c.step_p99_ms:.2f}", "")
    for one in c.services:
        if one.busy_p99_ms is not None:
            grown = f"{one.busy_p99_ms:.2f} ({one.busy_p99_ms - c.step_p99_ms:+.2f})"
            most = f"{c.step_p99_ms + STALL_GOAL_MS:.2f} ({STALL_GOAL_MS:+.2f})"
            rows.add(f"{one.service}: the same with {requests} in flight", grown, most)
    rows.add("inverse kinematics/s", f"{c.ik:,.0f}", f"{IK_GOAL:,}")
    for name, rate in (c.postures or {}).items():
        rows.add(f"joint positions without a path/s, {name}", f"{rate:,.0f}", "")
    if c.pairs is not None:
        p = c.pairs
        rows.add(f"two arms of {p.robot}: reached, solved, free", f"{p.reached}, {p.solved}, {p.free}", f"{p.pairs}")
        rows.add(f"two arms of {p.robot}: a plan [ms]", f"{p.plan_ms:.1f}", "")
    if json:
        plain = {"services": [s._asdict() for s in c.services], "missed": c.missed}
        plain |= {"bare": c.bare and c.bare._asdict(), "pairs": c.pairs and c.pairs._asdict()}
        print_json(c._asdict() | plain)
    for sentence in c.missed:
        typer.echo(sentence, err=True)
    if c.missed:
        raise typer.Exit(1)


@app.command("resets")
def resets(
    engine: Annotated[
        str, typer.Option("--engine", "-e", help="Engines, separated by commas; `all` are those whose entities vary.")
    ] = "all",
    count: Annotated[int, typer.Option("--resets", "-r", min=20, help="Partial resets, each with other entities.")] = (
        2_000
    ),
    num_envs: Annotated[
        int, typer.Option("--num-envs", "-n", min=1, help="Envs, of which each reset changes one.")
    ] = 4,
    json: AsJson = False,
) -> None:
    """Change which objects are present in thousands of partial resets, and see whether anything accumulates.

    A Panda, a table and ten things, each a box, a ball, a can or nothing. Memory, open files, threads and what the
    engine holds of its library are printed on the way; the exit code is 1 where something grew. More resets find
    smaller leaks.

    Examples:
      anysim bench resets --engine sapien --resets 10000
    """
    from anysim.cli.output import print_json
    from anysim.engine.capability import Capability
    from anysim.engine.factory import runnable
    from anysim_bench.resets import ResetCost, Sample, reset_cost
    from anysim_bench.rows import Rows

    def tell(sample: Sample) -> None:
        typer.echo(f"  {sample.resets} resets: {_held(sample)}", err=True)

    able = runnable(Capability.VARYING_ENTITIES)
    names = list(able) if engine == "all" else [name.strip() for name in engine.split(",")]
    costs: list[ResetCost] = []
    title = f"{count:,} partial resets with other entities, {num_envs} envs; processor time of one reset"
    heads = ("engine", "lifecycle", "first [ms]", "last [ms]", "same entities [ms]", "growth", "early", "late")
    rows = Rows(title, heads, (9, 22, 0, 0, 0, 6, 60), quiet=json)
    for name in names:
        typer.echo(f"resetting {name} {count:,} times…", err=True)
        c = reset_cost(name, count, num_envs, tell)
        costs.append(c)
        rows.add(
            c.engine,
            c.lifecycle,
            f"{c.first_ms:.2f}",
            f"{c.last_ms:.2f}",
            f"{c.same_ms:.2f}",
            "; ".join(c.grown) or "none",
            _held(c.samples[len(c.samples) // 5]),
            _held(c.samples[-1]),
        )
    if json:
        print_json([cost._asdict() | {"samples": [s._asdict() for s in cost.samples]} for cost in costs])
    if any(cost.grown for cost in costs):
        raise typer.Exit(1)


def _held(sample: Any) -> str:
    handles = "".join(f", {number} {name}" for name, number in sample.handles.items())
    return f"{sample.memory_mib:.0f} MiB, {sample.descriptors} files, {sample.threads} threads{handles}"
