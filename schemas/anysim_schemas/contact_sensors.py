"""Contact sensors."""

from pydantic import Field

from anysim_schemas.base import Name, Spec


class ContactSensorSpec(Spec):
    """Net contact force on an entity or link, in newtons, world axes."""

    body: str = Field(description="an entity (`cube`) or one of its links (`panda.panda_leftfinger`)")
    against: Name | None = Field(default=None, description="count only contacts with this entity")
