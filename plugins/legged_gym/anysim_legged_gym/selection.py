"""Selection of an engine: by argument, by file, by the environment variable SIMULATOR, or anysim's default."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from anysim.api import resolve_options
from anysim.engine.factory import default_engine
from anysim_legged_gym.spec import LeggedSpec
from anysim_schemas.engine import EngineSpec
from anysim_schemas.load import load

SIMULATOR = "SIMULATOR"
"""The environment variable that legged-gym code sets. It is read when a simulator is made, never at import."""


def load_spec(source: str | Path | Mapping[str, Any] | LeggedSpec, overrides: Sequence[str] = ()) -> LeggedSpec:
    """A spec from a YAML file, a mapping, or as it is; `overrides` such as `control.action_scale=0.3` on top.

    Raises:
        SpecError: every fault with file, line and column.
    """
    given = source.to_dict() if isinstance(source, LeggedSpec) else source
    if isinstance(source, LeggedSpec) and not overrides:
        return source
    return load(LeggedSpec, given, overrides=overrides, resolver=resolve_options).spec


def chosen_engine(spec: LeggedSpec, simulator: str | None = None) -> EngineSpec:
    """The engine that an argument names, else the file, else SIMULATOR, else what anysim takes by default.

    A file's options stay where the argument names the same engine.
    """
    if simulator is not None:
        kept = spec.simulator if spec.simulator is not None and spec.simulator.name == simulator else None
        return kept or EngineSpec(name=simulator)
    if spec.simulator is not None:
        return spec.simulator
    return EngineSpec(name=os.environ.get(SIMULATOR) or default_engine())
