"""Options of an engine, as YAML writes them under `engine.options`."""

from typing import ClassVar

from pydantic import BaseModel, ConfigDict


class EngineOptions(BaseModel):
    """Base of the options of an engine. Unknown names are refused.

    `shaping` names the options that change trajectories: where they are not the defaults they are part of the engine's
    version, which stamps snapshots and records.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    shaping: ClassVar[tuple[str, ...]] = ()

    def trajectory_stamp(self) -> str:
        """The options that change trajectories, where they differ from the defaults: `iterations=20,tolerance=0.1`."""
        values = ((name, getattr(self, name), type(self).model_fields[name].default) for name in self.shaping)
        return ",".join(f"{name}={value}" for name, value, usual in values if value != usual)
