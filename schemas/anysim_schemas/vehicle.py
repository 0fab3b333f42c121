"""Vehicles: the wheels of a robot, or the joints that move it over a plane.

The frame of the base has x forward, y to the left and z up. A wheel's joint turns about y: positive rolls forward; a
steering joint turns about z. What is said here is compared with the model when a world is compiled.
"""

from typing import Annotated, Literal

from pydantic import Field

from anysim_schemas.base import Number, Positive, Spec

Rolling = Annotated[
    Literal["source", "sphere"],
    Field(
        description="what of a wheel touches the ground: the source's shapes, or a sphere of the wheel's radius in "
        "their place, which is round on every engine and does not resist being turned on the spot"
    ),
]


class DifferentialSpec(Spec):
    """Wheels on both sides of one axle: it turns by their difference in speed. Castors carry the rest."""

    kind: Literal["differential"] = Field(description="two wheels, or two rows of them, on one axle")
    left: str = Field(description="joint of the left wheel")
    right: str = Field(description="joint of the right wheel")
    wheel_radius: Positive = Field(description="[m]")
    track: Positive = Field(description="distance of the two wheels [m]")
    rolling: Rolling = "source"


class AckermannSpec(Spec):
    """A car: the front wheels steer about one centre of turning, which lies on the line of the rear axle."""

    kind: Literal["ackermann"] = Field(description="a car, whose front wheels steer")
    steering_left: str = Field(description="joint that steers the left front wheel; positive is to the left")
    steering_right: str = Field(description="joint that steers the right front wheel")
    rear_left: str = Field(description="joint of the left rear wheel, which is driven")
    rear_right: str = Field(description="joint of the right rear wheel, which is driven")
    front_left: str | None = Field(default=None, description="joint of the left front wheel, where it is driven too")
    front_right: str | None = Field(default=None, description="joint of the right front wheel, where it is driven too")
    wheel_radius: Positive = Field(description="[m]")
    track: Positive = Field(description="distance of the left and right wheels [m], and of the steering axes")
    wheelbase: Positive = Field(description="distance of the front and rear axles [m]")
    max_steering: Annotated[Positive, Field(lt=1.5)] = Field(
        description="largest angle of a wheel in the middle of the front axle [rad]; it limits the curvature"
    )
    rolling: Rolling = "source"


class SwerveModuleSpec(Spec):
    """A wheel that is driven and steered, its steering axis through the middle of the wheel."""

    steer: str = Field(description="joint that steers it, at 0 the wheel rolls forward; positive is to the left")
    wheel: str = Field(description="joint that drives it")
    position: tuple[Number, Number] = Field(description="x, y of the steering axis in the base's frame [m]")
    radius: Positive = Field(description="of the wheel [m]")


class SwerveSpec(Spec):
    """Two or more wheels that are each driven and steered: it moves in any direction while it turns."""

    kind: Literal["swerve"] = Field(description="wheels that are each driven and steered")
    modules: tuple[SwerveModuleSpec, ...] = Field(min_length=2, description="the wheels")
    rolling: Rolling = "source"


class PlanarSpec(Spec):
    """Three joints that move it over a plane, without wheels: with `base: planar` they are put under the robot."""

    kind: Literal["planar"] = Field(description="three joints that move it over a plane, in place of wheels")
    x: str = Field(default="base_x", description="joint along the world's x axis at home")
    y: str = Field(default="base_y", description="joint along y, on the one of x")
    yaw: str = Field(default="base_yaw", description="joint about z, on the one of y")
    lifted: tuple[str, ...] = Field(
        default=(), description="links, as wheels, that do not touch anything: the joints carry; `*` matches any part"
    )


VehicleSpec = Annotated[DifferentialSpec | AckermannSpec | SwerveSpec | PlanarSpec, Field(discriminator="kind")]


def wheels_of(spec: DifferentialSpec | AckermannSpec | SwerveSpec | PlanarSpec) -> dict[str, float]:
    """The radius [m] of each driven wheel, by its joint."""
    if isinstance(spec, PlanarSpec):
        return {}
    if isinstance(spec, SwerveSpec):
        return {module.wheel: module.radius for module in spec.modules}
    names = (spec.left, spec.right) if isinstance(spec, DifferentialSpec) else rear_and_front(spec)
    return dict.fromkeys(names, spec.wheel_radius)


def rear_and_front(spec: AckermannSpec) -> tuple[str, ...]:
    """The driven wheels of a car: left and right at the rear, and at the front where they are driven."""
    front = [name for name in (spec.front_left, spec.front_right) if name is not None]
    return (spec.rear_left, spec.rear_right, *front)


def joints_of(spec: DifferentialSpec | AckermannSpec | SwerveSpec | PlanarSpec) -> tuple[str, ...]:
    """The joints that a vehicle's controller commands."""
    match spec:
        case DifferentialSpec():
            return (spec.left, spec.right)
        case AckermannSpec():
            return (spec.steering_left, spec.steering_right, *rear_and_front(spec))
        case SwerveSpec():
            return (*(m.steer for m in spec.modules), *(m.wheel for m in spec.modules))
        case PlanarSpec():
            return (spec.x, spec.y, spec.yaw)
