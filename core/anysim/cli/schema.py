"""`anysim schema`: JSON Schemas for editors."""

from enum import StrEnum
from typing import Annotated

import typer


class Root(StrEnum):
    """The kinds of files that have a schema."""

    RUN = "run"
    ROBOT = "robot"


def schema(
    root: Annotated[Root, typer.Argument(help="run: worlds and tasks; robot: catalogue entries.")] = Root.RUN,
) -> None:
    """Print the JSON Schema of a kind of file, for completion and checks in an editor.

    Examples:
      anysim schema run > run.schema.json
    """
    from anysim.cli.output import print_json
    from anysim_schemas.jsonschema import json_schema
    from anysim_schemas.robot_model import RobotModelSpec
    from anysim_schemas.run import RunSpec

    print_json(json_schema(RunSpec if root is Root.RUN else RobotModelSpec))
