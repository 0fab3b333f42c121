"""`anysim benchmark`: policies compared on the tasks and engines of a frozen protocol."""

from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from anysim.cli.options import AsJson
from anysim_processes.options import Executor

if TYPE_CHECKING:
    from collections.abc import Mapping

    from anysim_evaluation.benchmark.protocol import Protocol

app = typer.Typer(help="Compare policies on the tasks and engines of a frozen protocol.", no_args_is_help=True)

RESULTS, PAGE, COSTS = "results.json", "results.html", "costs.json"

Name = Annotated[
    str, typer.Argument(metavar="PROTOCOL", help="A shipped protocol (`anysim benchmark list`) or a YAML file.")
]


@app.command("list")
def list_protocols(json: AsJson = False) -> None:
    """List the protocols that come with this package."""
    from anysim.cli.output import print_json, print_table
    from anysim_evaluation.benchmark.protocol import load_protocol, shipped

    specs = [load_protocol(name).spec for name in shipped()]
    rows = [
        (s.name, len(s.tasks), len(s.policies), ", ".join(s.engines), s.seeds.episodes, s.description) for s in specs
    ]
    if json:
        print_json([spec.to_dict() for spec in specs])
    else:
        print_table("Protocols", ("name", "tasks", "policies", "engines", "episodes", "what"), rows)


@app.command()
def show(protocol: Name, json: AsJson = False) -> None:
    """Say what a protocol compares, what its figures depend on, and what of that has moved since it was frozen.

    Examples:
      anysim benchmark show core12
    """
    from anysim.cli.output import print_json, print_table
    from anysim_evaluation.benchmark.freezing import hash_of, moved, parts
    from anysim_evaluation.benchmark.protocol import load_protocol

    loaded = load_protocol(protocol)
    now = parts(loaded)
    changed = moved(loaded, now) if loaded.frozen.exists() else ["it was never frozen"]
    if json:
        print_json({"protocol": loaded.spec.to_dict(), "hash": hash_of(now), "parts": now, "moved": changed})
        return
    print_table(f"{loaded.spec.name}: {loaded.spec.description}", ("part", "is"), list(now.items()))
    typer.echo(f"hash {hash_of(now)}; {'as frozen' if not changed else 'moved: ' + '; '.join(changed)}")


@app.command()
def freeze(protocol: Name) -> None:
    """Write what the figures of a protocol depend on into PROTOCOL.frozen.json beside it.

    `anysim benchmark run` then refuses to run anything else.

    Examples:
      anysim benchmark freeze my_protocol.yaml
    """
    from anysim_evaluation.benchmark import freezing
    from anysim_evaluation.benchmark.protocol import load_protocol

    loaded = load_protocol(protocol)
    digest, changed = freezing.freeze(loaded)
    for words in changed:
        typer.echo(words)
    typer.echo(f"{loaded.frozen}: {digest}")


@app.command()
def run(
    protocol: Name,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            "-w",
            min=1,
            help="Worker processes, or workers of --executor at most; results do not depend on it. [default: 1]",
        ),
    ] = None,
    executor: Executor = None,
    out: Annotated[Path | None, typer.Option(help="Directory of the results; default runs/benchmark-NAME.")] = None,
    only: Annotated[
        str, typer.Option(metavar="TASK/ENGINE/POLICY", help="Run these alone now; `*` stands for all of a kind.")
    ] = "",
    policy: Annotated[
        list[str] | None,
        typer.Option("--policy", "-p", metavar="NAME=POLICY", help="A policy more than the protocol has."),
    ] = None,
    moved: Annotated[
        bool, typer.Option("--moved", help="Run although something is not as frozen; the results say so.")
    ] = False,
    json: AsJson = False,
) -> None:
    """Run what is left of a benchmark, and write results.json and one page.

    Each episode is on the disk once it has ended: the same command again goes on where an interrupted one stopped. What
    is not as it was frozen is refused, with the part that moved.

    Examples:
      anysim benchmark run core12 --workers 2
      anysim benchmark run core12 --only reach/mujoco --out runs/try
      anysim benchmark run core12 --executor ray
      anysim benchmark run core12 --policy mine=my_policies:act
    """
    from anysim.cli.output import counting, print_json
    from anysim.errors import TaskError, listing
    from anysim_evaluation.benchmark import freezing, running
    from anysim_evaluation.benchmark.protocol import load_protocol

    loaded = load_protocol(protocol, policy or ())
    parts = freezing.parts(loaded)
    changed = freezing.moved(loaded, parts)
    if changed and not moved:
        raise TaskError(
            f"{loaded.path} is not what was frozen: {listing(changed)}. Put that back; or run with --moved, for "
            "no results of this protocol; or freeze it anew (`anysim benchmark freeze`), which makes it another one"
        )
    folder = out or Path("runs") / f"benchmark-{loaded.spec.name}"
    there = running.logged(loaded, parts, folder)
    chosen = running.cells(loaded, only)
    total = len(loaded.seeds()) * len(chosen) - sum(len(there[cell]) for cell in chosen)
    with counting(loaded.spec.name, total, json) as tell:
        running.run(loaded, parts, folder, only=only, workers=workers, executor=executor, tell=tell)
    told = write_results(loaded, parts, changed, folder)
    if json:
        print_json(told)
    else:
        _tell(told)
        typer.echo(f"the page: {folder / PAGE}")


def write_results(loaded: "Protocol", parts: "Mapping[str, str]", changed: list[str], folder: Path) -> dict[str, Any]:
    """Sum up the episodes that are there; the same bytes for the same episodes, but for what they cost.

    Returns:
        What results.json holds.
    """
    from anysim.record.commit import write_whole
    from anysim_evaluation.benchmark import running
    from anysim_evaluation.benchmark.freezing import hash_of
    from anysim_evaluation.benchmark.page import page
    from anysim_evaluation.benchmark.results import figures

    found = running.logged(loaded, parts, folder)
    absent = list(running.absences(loaded, folder))
    episodes = len(loaded.seeds())
    told = {
        "format": "anysim-benchmark-1",
        "protocol": loaded.spec.name,
        "description": loaded.spec.description,
        "frozen": hash_of({key: words for key, words in parts.items() if key[9:] not in loaded.added}),
        "moved": changed,
        "added": list(loaded.added),
        "parts": dict(parts),
        "episodes": episodes,
        "left": episodes * (len(found) - len(absent)) - sum(map(len, found.values())),
        "absent": absent,
        **figures(loaded.spec, found),
    }
    spent = list(running.costs(folder, found))
    files = {RESULTS: dumps(told, indent=1) + "\n", PAGE: page(told), COSTS: dumps(spent, indent=1) + "\n"}
    write_whole(folder, files)
    return told


def _tell(told: "Mapping[str, Any]") -> None:
    from anysim.cli.output import print_table

    engines = list(dict.fromkeys(one["engine"] for one in told["means"]))
    means = {(one["policy"], one["engine"]): one for one in told["means"]}
    rows = [
        (policy, *(_share(means.get((policy, engine))) for engine in engines))
        for policy in dict.fromkeys(one["policy"] for one in told["means"])
    ]
    print_table(f"{told['protocol']}: mean success over the tasks", ("policy", *engines), rows)
    for one in told["ranks"]:
        if one["task"] is None:
            kendall = "undefined" if one["kendall"] is None else f"{one['kendall']:.2f}"
            typer.echo(
                f"{one['engine']} orders the policies as {one['reference']}: Kendall {kendall}, MMRV {one['mmrv']:.3f}"
            )
    if told["left"]:
        typer.echo(f"{told['left']} episodes are left")


def _share(one: "Mapping[str, Any] | None") -> str:
    return "" if one is None else "{:.0%} ({:.0%} to {:.0%})".format(one["success"], *one["interval"])
