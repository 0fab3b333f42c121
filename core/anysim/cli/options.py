"""Options that several commands share."""

from typing import Annotated

import typer

Task = Annotated[str, typer.Argument(metavar="TASK", help="An installed task (`anysim list tasks`) or a YAML file.")]
Engine = Annotated[str | None, typer.Option("--engine", "-e", help="An installed engine; wins over the file.")]
NumEnvs = Annotated[
    int | None, typer.Option("--num-envs", "-n", min=1, help="Parallel environments; wins over the file.")
]
Seed = Annotated[
    int | None,
    typer.Option("--seed", "-s", min=0, help="The seed that everything random follows from; wins over the file's."),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "-o", "--override", metavar="KEY=VALUE", help="Override a value: `-o physics.dt=0.004`. May be repeated."
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON document for machines.")]
