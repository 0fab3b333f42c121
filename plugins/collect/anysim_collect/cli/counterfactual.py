"""`anysim counterfactual`: matched pairs of episodes, one factor changed, as a dataset."""

import json as text
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from anysim.cli.options import AsJson, Engine, Overrides, Robot, Seed, Task, with_robot
from anysim.errors import RecordError, TaskError, listing

if TYPE_CHECKING:
    from anysim.task.env import TaskEnv
    from anysim_collect.pairs import Actions

PAIRS_FILE, PICTURE, FORMAT = "pairs.json", "pairs.svg", "anysim-pairs-1"


def counterfactual(
    task: Task,
    factor: Annotated[
        list[str],
        typer.Option(
            "--factor", metavar="PATH=VALUE", help="What is changed in the second of a pair. May be repeated."
        ),
    ],
    pairs: Annotated[int, typer.Option("--pairs", "-k", min=1, help="How many pairs.")] = 1,
    engine: Engine = None,
    actions: Annotated[
        str,
        typer.Option(
            help="policy: the task's expert acts in each as it sees it; same: the second gets the actions of the first."
        ),
    ] = "policy",
    tolerance: Annotated[
        float, typer.Option(min=0.0, help="By how much states must differ, to be apart [m, rad, m/s, rad/s].")
    ] = 1e-6,
    at_once: Annotated[
        int, typer.Option(min=1, help="Pairs that run side by side, two envs each; what comes of each is the same.")
    ] = 1,
    seed: Seed = None,
    robot: Robot = None,
    override: Overrides = None,
    out: Annotated[
        Path | None, typer.Option(help="Directory of the pairs; default runs/<task>-<engine>-<id>-pairs.")
    ] = None,
    json: AsJson = False,
) -> None:
    """Collect matched pairs: the same episode twice, with one factor changed and every other draw the same.

    Both are kept, however they end, as trajectories of one run: even envs as they are, odd ones changed. `pairs.json`
    says from which control step on the states of a pair are apart, and `pairs.svg` shows it. Running the same command
    again goes on where it stopped. A path that nothing has is answered with all that can be changed.

    Examples:
      anysim counterfactual pick_cube --factor objects.cube.mass=0.5 -k 8 --out runs/heavy
      anysim counterfactual push_cube --factor objects.cube.mass=1.5 -k 8 --actions same -o record.cameras=[]
    """
    import hashlib

    from anysim.api import make
    from anysim.record.names import run_name

    wanted = parse_factors(factor)
    if actions not in ("policy", "same"):
        raise TaskError(f"--actions is '{actions}'; policy or same expected")
    overrides = [*with_robot(override, robot), "record.keep=all"]
    with make(task, engine=engine, num_envs=2 * at_once, overrides=overrides) as env:
        env.counterfactuals.checked(wanted, 2 * at_once, midway=False)
        begin = env.spec.seed if seed is None else seed
        plan = {
            "format": FORMAT,
            "task": env.name,
            "engine": env.engine.name,
            "seed": begin,
            "factors": wanted,
            "actions": actions,
            "tolerance": tolerance,
            "at_once": at_once,
        }
        name = hashlib.sha256(text.dumps(plan).encode()).hexdigest()[:8]
        directory = (
            out or Path("runs") / f"{run_name(env.name, env.engine.name, env.spec.to_dict(), begin)}-{name}-pairs"
        )
        _claim(directory, plan)
        if not json:
            typer.echo(
                f"{env.name} on {env.engine.name} {env.engine.version}: {pairs} pairs, seed {begin}: {directory}"
            )
        told = _collect(env, directory, pairs, plan, quiet=json)
    say_pairs(directory, told, json)


def parse_factors(texts: Sequence[str]) -> dict[str, Any]:
    """Values by path, written `objects.cube.friction=0.2`; values are YAML.

    Raises:
        TaskError: one is not of this form, or a path is there twice.
    """
    from anysim_schemas.nodes import Fault
    from anysim_schemas.yaml import parse

    found: dict[str, Any] = {}
    for one in texts:
        path, equals, value = (part.strip() for part in one.partition("="))
        if not (path and equals and value):
            raise TaskError(f"--factor {one}: PATH=VALUE expected, as in objects.cube.friction=0.2")
        if path in found:
            raise TaskError(f"--factor {path} is given twice; one value for each expected")
        faults: list[Fault] = []
        node = parse(value, f"--factor {path}", faults)
        if node is None or faults:
            why = faults[0].message if faults else "it is empty"
            raise TaskError(f"--factor {one}: the value is no YAML: {why}")
        found[path] = node.plain()
    return found


def read_pairs(out: Path) -> dict[str, Any]:
    """The content of `pairs.json`.

    Raises:
        RecordError: there is none, or it is none of ours.
    """
    try:
        told = text.loads((out / PAIRS_FILE).read_text())
    except (OSError, ValueError) as error:
        raise RecordError(f"{out / PAIRS_FILE} cannot be read: {error}") from error
    if not isinstance(told, dict) or told.get("format") != FORMAT:
        raise RecordError(
            f"{out / PAIRS_FILE} is not of the format {FORMAT}; name a directory of `anysim counterfactual`"
        )
    return told


def _claim(out: Path, plan: dict[str, Any]) -> None:
    """Say in a directory of which pairs it is, before the first is there.

    Raises:
        RecordError: it is of others.
    """
    from anysim.record.commit import write_whole
    from anysim.record.names import trajectories

    if (out / PAIRS_FILE).exists():
        there = read_pairs(out)
        differing = [key for key in plan if there.get(key) != text.loads(text.dumps(plan[key]))]
        if differing:
            raise RecordError(f"{out} holds other pairs: {listing(differing)} differ; name another directory")
        return
    if trajectories(out):
        raise RecordError(f"{out} holds trajectories that are no pairs; name another directory")
    out.mkdir(parents=True, exist_ok=True)
    write_whole(out, {PAIRS_FILE: text.dumps(plan | {"pairs": [], "incomplete": []}, indent=2) + "\n"})


def _collect(env: "TaskEnv", out: Path, count: int, plan: dict[str, Any], quiet: bool) -> dict[str, Any]:
    """Run what is lacking, and write both pages about it."""
    from anysim.cli.output import counting
    from anysim.record.commit import write_whole
    from anysim.skills.runner import SkillPolicy
    from anysim_collect.divergence import gap_of, pair_entry
    from anysim_collect.divergence_plot import Gap, divergence_picture
    from anysim_collect.mixture import size_of
    from anysim_collect.pairs import CHANGED, SAME, PairCollector, Tape, member
    from anysim_collect.report import report_of, write_report
    from anysim_collect.tally import Tally

    kind: Actions = plan["actions"]
    tally, parts = Tally(), dict[str, float]()
    passes = ((SAME, CHANGED),) if kind == "policy" else ((SAME,), (CHANGED,))
    with counting("episodes", 2 * count, quiet=quiet) as show:
        for members in passes:
            policy = SkillPolicy(env) if SAME in members else Tape(env, out)
            collector = PairCollector(env, policy, out, count, plan["seed"], plan["factors"], members)
            for result in collector.run():
                tally.add(result, 0 if result.path is None else size_of(result.path))
                show(f"env {result.env} episode {result.episode}: {result.status} after {result.steps} steps")
            for part, seconds in collector.times.parts().items():
                parts[part] = parts.get(part, 0.0) + seconds
    found: list[dict[str, Any]] = []
    incomplete: list[int] = []
    gaps: list[Gap] = []
    for episode in range(count):
        first, second = (member(out, which, episode, plan["at_once"]) for which in (SAME, CHANGED))
        if first.is_dir() and second.is_dir():
            found.append(pair_entry(episode, first, second, plan["tolerance"]))
            gaps.append(Gap(episode, gap_of(first, second), found[-1]["diverges"]))
        else:
            incomplete.append(episode)
    told = plan | {"pairs": found, "incomplete": incomplete}
    factors = ", ".join(f"{path}={value}" for path, value in plan["factors"].items())
    picture = divergence_picture(f"{env.name} on {env.engine.name}: {factors}", gaps, plan["tolerance"])
    write_whole(out, {PICTURE: picture, PAIRS_FILE: text.dumps(told, indent=2, default=str) + "\n"})
    what = {"task": env.name, "engine": env.engine.name, "num_envs": env.num_envs, "seed": plan["seed"]}
    what |= {"engine_version": f"{env.engine.name} {env.engine.version}"}
    write_report(out, report_of(what, tally, parts, 0.0))
    return told


def say_pairs(out: Path, told: dict[str, Any], json: bool) -> None:
    """Print a table of pairs, and how many are apart."""
    from anysim.cli.output import print_json, print_table

    if json:
        print_json({"out": str(out), **told})
        return
    print_table(
        "Pairs",
        ("episode", "as it is", "changed", "apart from step", "actions from step", "largest in a pose"),
        [_row(pair) for pair in told["pairs"]],
    )
    if told["incomplete"]:
        typer.echo(f"incomplete, as a member faulted: episodes {listing(map(str, told['incomplete']))}", err=True)
    apart = sum(pair["diverges"] is not None for pair in told["pairs"])
    typer.echo(
        f"{apart} of {len(told['pairs'])} pairs are apart by more than {told['tolerance']:g}; {out / PAIRS_FILE}"
    )
    if told["pairs"] and all(pair["differs"] is None for pair in told["pairs"]):
        rubs = any(path.endswith(".friction") for path in told["factors"])
        why = ": of two surfaces that touch the larger friction counts, or that of the higher priority, as pads have"
        typer.echo(f"not one bit differs: nothing that happened depends on the factor{why if rubs else ''}", err=True)


def _row(pair: dict[str, Any]) -> tuple[Any, ...]:
    ends = [f"{status} ({steps})" for status, steps in zip(pair["status"], pair["steps"], strict=True)]
    since = ["never" if pair[key] is None else pair[key] for key in ("diverges", "acts_apart")]
    return (pair["episode"], *ends, *since, f"{pair['largest']['body_pose']:.3g}")
