"""`anysim verdicts`: do peers call the same states a success?"""

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from anysim.cli.options import AsJson

if TYPE_CHECKING:
    from collections.abc import Sequence

    from anysim_maniskill.verdicts.pair import Agreement, Pair


def verdicts(
    names: Annotated[
        list[str] | None, typer.Argument(help="Peers, tasks of peers, or tasks of anysim; all without a name.")
    ] = None,
    states: Annotated[int, typer.Option(min=1, help="How many states are drawn around each boundary.")] = 1000,
    seed: Annotated[int, typer.Option("--seed", "-s", min=0, help="What they are drawn from.")] = 0,
    json: AsJson = False,
) -> None:
    """Judge the same states by our tasks' success and by that of peers' tasks, and say where they differ and why.

    States are drawn around each boundary of a success: distances, heights, speeds, angles. Where the two rules differ
    on purpose, our rule is judged with the difference taken out as well; what differs even then has no explanation, and
    the exit code is 1. Needs the peers: pip install 'anysim-maniskill[maniskill]', best in an environment of its own.

    Examples:
      anysim verdicts maniskill
      anysim verdicts maniskill:StackCube-v1 robosuite:Stack --states 5000
    """
    from anysim.cli.output import print_json
    from anysim_maniskill.verdicts.pair import agreements
    from anysim_maniskill.verdicts.table import chosen

    pairs = chosen(names or ())
    found = [agreement for pair in pairs for agreement in agreements(pair, states, seed)]
    if json:
        print_json([asdict(agreement) for agreement in found])
    else:
        _tell(pairs, found)
    if any(agreement.unexplained for agreement in found):
        raise typer.Exit(1)


def _tell(pairs: "Sequence[Pair]", found: "Sequence[Agreement]") -> None:
    from anysim.cli.output import print_table

    columns = ("peer", "task", "boundary", "states", "we say yes", "the peer does", "differ", "by", "unexplained")
    rows = [
        (
            a.peer,
            a.task,
            a.boundary,
            a.states,
            a.ours,
            a.theirs,
            a.differ,
            ", ".join(f"{count} {name}" for name, count in a.by.items() if count) or "-",
            a.unexplained,
        )
        for a in found
    ]
    print_table("Verdicts on the same states", columns, rows)
    reasons = [(pair.peer, name, d.reason) for pair in pairs for name, d in pair.differences.items()]
    if reasons:
        print_table("Where the rules differ on purpose", ("peer", "by", "why"), reasons)
    typer.echo(f"{sum(a.unexplained for a in found)} of {sum(a.states for a in found)} states without an explanation")
