"""Proposals: poses of objects by name, from a model, a program or a person."""

from typing import Annotated

from pydantic import Field

from anysim_schemas.base import Name, Number, Spec, Vec3

Quaternion = tuple[Number, Number, Number, Number]


class ProposedPose(Spec):
    """Where one thing goes: `position` [m] of its frame origin from the origin of the env, and its orientation."""

    position: Vec3 = Field(description="place of the frame origin [m], from the origin of the env")
    quaternion: Quaternion | None = Field(default=None, description="orientation x, y, z, w, of length 1")
    yaw: Number = Field(default=0.0, description="angle [rad] about the vertical; instead of a quaternion")


class Proposal(Spec):
    """Poses of some or all of the objects; the others go where the layout says."""

    poses: dict[Name, ProposedPose] = Field(description="poses by the names of the objects")
    reason: Annotated[str, Field(max_length=10_000)] = Field(
        default="", description="why, in words; kept in the record"
    )


class Proposals(Spec):
    """Several proposals, of which each episode draws one."""

    proposals: tuple[Proposal, ...] = Field(min_length=1, description="as likely as each other")
