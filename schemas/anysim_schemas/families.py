"""Families of a world: matter and people that a plugin makes, moves and remembers beside the engine."""

from typing import Any, ClassVar

from pydantic import ConfigDict, Field, field_validator

from anysim_schemas.base import Spec

OF_OBJECTS = ("rigid", "articulation", "rigid_instancer")
"""Families that engines hold by themselves: what an object is."""


class FamilySpec(Spec):
    """A family with its parameters beside it: `{kind: avatar, count: 2}`."""

    model_config = ConfigDict(extra="allow", frozen=True)
    plugin_kind: ClassVar[str] = "family"
    plugin_name_field: ClassVar[str] = "kind"

    kind: str = Field(description="an installed family, as in `anysim list families`")

    @field_validator("kind")
    @classmethod
    def _of_no_objects(cls, kind: str) -> str:
        if kind in OF_OBJECTS:
            raise ValueError(f"'{kind}' is what an object is: declare it as `objects: {{NAME: {{family: {kind}}}}}`")
        return kind

    @property
    def params(self) -> dict[str, Any]:
        """The parameters of the family, as written."""
        return dict(self.model_extra or {})
