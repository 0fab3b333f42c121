"""The choice of collision geometry: what the meshes of a source collide as."""

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from anysim_schemas.base import Integer, Number, Spec
from anysim_schemas.errors import KeyFault

COLLISION = "what meshes collide as: hull, decompose, mesh or primitives; their convex hulls where it is left out"
PIECES = 256
"""Pieces that one mesh may be cut into at most."""


class CollisionShapesSpec(Spec):
    """What the meshes of a source collide as. A bare string is the `method` with its defaults."""

    method: Literal["hull", "decompose", "mesh", "primitives"] = Field(
        description="`hull`: the convex hull of each mesh; `decompose`: convex pieces of it; `mesh`: its triangles, of "
        "what is fixed; `primitives`: of box, ball, cylinder and capsule the one that is nearest to it"
    )
    concavity: Annotated[Number, Field(ge=0.01, le=1.0)] = Field(
        default=0.05,
        description="how far the surface of a piece may be off its hull, as a share of half the mesh's longest side; "
        "of `decompose`",
    )
    pieces: Annotated[Integer, Field(ge=1, le=PIECES)] = Field(
        default=32, description="the most pieces of one mesh, of `decompose`"
    )

    @classmethod
    def from_text(cls, text: str) -> dict[str, Any]:
        """The method, with its defaults."""
        return {"method": text}

    @classmethod
    def text_means(cls) -> str:
        """What a bare string means, for editors."""
        return "hull, decompose, mesh or primitives, with its defaults"

    @model_validator(mode="after")
    def _of_the_method(self) -> "CollisionShapesSpec":
        for key in ("concavity", "pieces"):
            if key in self.model_fields_set and self.method != "decompose":
                raise KeyFault(f"`{key}` is for `method: decompose`; leave it out of `method: {self.method}`", key)
        return self
