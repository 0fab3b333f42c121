"""Which things pass through each other."""

from pydantic import Field

from anysim_schemas.base import Name, Reference, Spec


class CollisionsSpec(Spec):
    """What never collides. Everything else does, but a link with its parent, and what is fixed with what is fixed.

    A name is an entity (`cube`), a link (`panda.panda_hand`), the ground (`terrain`), or a group of these. A pair of a
    group with itself lets its members pass through each other, a pair of a robot with itself the robot's own links.
    """

    groups: dict[Name, tuple[Reference, ...]] = Field(
        default_factory=dict, description="names for several entities or links together"
    )
    exclude: tuple[tuple[Reference, Reference], ...] = Field(
        default=(), description="pairs that never collide: entities, links, groups, or the ground `terrain`"
    )
