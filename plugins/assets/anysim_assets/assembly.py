"""Links made of solids, which a builder adds up to a model, with masses and inertias that follow from the solids."""

from collections.abc import Iterator, Sequence
from math import atan2, cos, hypot, inf, pi, sin, tan

import numpy as np

from anysim.assets.model import ImportedModel
from anysim.conventions import IDENTITY_QUATERNION
from anysim.kinematics import inertia
from anysim.math import pose as P
from anysim.model.affordances import Affordance
from anysim.model.appearance import rgb
from anysim.model.hash import split, tidy
from anysim.model.world import (
    ORIGIN,
    Body,
    BodyKind,
    Box,
    Geom,
    Inertial,
    Joint,
    JointType,
    Quat,
    Shape,
    Site,
    Surface,
    Vec3,
)
from anysim_schemas.errors import KeyFault

Colour = str | Sequence[float]


class Assembly:
    """A tree of links in the making. The root is link 0, named `base`; every other link has a joint of its own name."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._bodies: list[Body] = [Body("base", BodyKind.FREE)]
        self._joints: list[Joint] = []
        self._geoms: list[Geom] = []
        self._sites: list[Site] = []
        self._masses: list[list[Inertial]] = [[]]
        self._affordances: list[Affordance] = []

    def link(
        self,
        name: str,
        position: Vec3,
        type: JointType,
        axis: Vec3,
        *,
        lower: float = -inf,
        upper: float = inf,
        friction: float = 0.0,
        damping: float = 0.0,
        velocity_limit: float = inf,
        effort_limit: float = inf,
        parent: int = 0,
    ) -> int:
        """A link on the root or on `parent`, its frame at `position` and parallel to that one's at joint zero.

        What is on a link comes right after it: bodies are depth first.
        """
        self._bodies.append(Body(name, BodyKind.LINK, parent, tidy(np.array(position))))
        self._masses.append([])
        body = len(self._bodies) - 1
        start = min(max(0.0, lower), upper)
        self._joints.append(
            Joint(
                name,
                body,
                type,
                axis,
                lower=lower,
                upper=upper,
                velocity_limit=velocity_limit,
                effort_limit=effort_limit,
                damping=damping,
                friction=friction,
                initial=start,
            )
        )
        return body

    def name_of(self, body: int) -> str:
        """The name of a link."""
        return self._bodies[body].name

    def solid(
        self,
        body: int,
        name: str,
        shape: Shape,
        position: Vec3,
        density: float,
        color: Colour,
        quaternion: Quat = IDENTITY_QUATERNION,
        *,
        filled: Shape | None = None,
        collides: bool = True,
        alpha: float = 1.0,
    ) -> None:
        """A homogeneous solid [kg/m^3] on a link, which has the mass of `filled` where that is given.

        One that does not collide is there for its mass and its looks. `alpha` is 1 for what is opaque.

        Solids of one link should not overlap but where `filled` says which part of one counts.
        """
        place, turn = split(np.array([*position, *quaternion]))
        owner = self._bodies[body].name
        self._geoms.append(
            Geom(f"{owner}.{name}", body, shape, place, turn, color=(*rgb(color), alpha), collides=collides)
        )
        heavy = filled or shape
        own = inertia.of_shape(heavy, density * inertia.volume(heavy, {}), {})
        self._masses[body].append(inertia.moved(own, np.array([*place, *turn])))

    def contact(self, body: int, name: str, shape: Shape, position: Vec3, surface: Surface) -> None:
        """A shape on a link that has neither mass nor looks: what touches in place of a solid that does not."""
        owner = self._bodies[body].name
        self._geoms.append(
            Geom(f"{owner}.{name}", body, shape, tidy(np.array(position)), surface=surface, visible=False)
        )

    def board(
        self,
        body: int,
        name: str,
        low: Vec3,
        high: Vec3,
        density: float,
        color: Colour,
        origin: Vec3 = ORIGIN,
        alpha: float = 1.0,
    ) -> None:
        """A box between two corners, given in axes parallel to the link's from a point `origin` of the same axes."""
        corners = np.array([low, high]) - np.array(origin)
        half, middle = 0.5 * (corners[1] - corners[0]), 0.5 * (corners[0] + corners[1])
        self.solid(body, name, Box(tidy(half)), tidy(middle), density, color, alpha=alpha)

    def open_box(self, body: int, size: Vec3, wall: float, density: float, color: Colour, key: str) -> None:
        """A floor and four walls of boards over the link's origin, of an outer `size`; `key` is the parameter's name.

        Raises:
            KeyFault: the walls leave nothing inside.
        """
        x, y, z = size[0] / 2, size[1] / 2, size[2]
        if min(x, y) <= wall or z <= wall:
            raise KeyFault(f"walls of {wall:g} m leave nothing of the {key}", key)
        for name, low, high in (
            ("floor", (-x, -y, 0.0), (x, y, wall)),
            ("back", (-x, -y, wall), (-x + wall, y, z)),
            ("front", (x - wall, -y, wall), (x, y, z)),
            ("right", (-x + wall, -y, wall), (x - wall, -y + wall, z)),
            ("left", (-x + wall, y - wall, wall), (x - wall, y, z)),
        ):
            self.board(body, name, low, high, density, color)

    def site(self, body: int, name: str, position: Vec3, quaternion: Quat = IDENTITY_QUATERNION) -> None:
        """A named frame on a link."""
        self._sites.append(Site(name, body, *split(np.array([*position, *quaternion]))))

    def afford(self, affordance: Affordance) -> None:
        """Where a hand may take hold of what has been put together; in the names of its links, sites and geoms."""
        self._affordances.append(affordance)

    def model(self) -> ImportedModel:
        """What has been put together."""
        bodies = tuple(
            Body(b.name, b.kind, b.parent, b.position, b.quaternion, inertia.moving(inertia.composed(parts)))
            for b, parts in zip(self._bodies, self._masses, strict=True)
        )
        return ImportedModel(
            self.name,
            bodies,
            tuple(self._joints),
            tuple(self._geoms),
            tuple(bodies[g.body].name for g in self._geoms),
            tuple(self._sites),
            links={body.name: i for i, body in enumerate(bodies)},
            affordances=tuple(self._affordances),
        )


def turned(axis: Vec3, angle: float) -> Quat:
    """The quaternion of a turn by `angle` [rad] about `axis`."""
    x, y, z, w = P.from_axis_angle(np.array(axis), np.array(angle)).tolist()
    return (x, y, z, w)


def ring(
    body: Assembly,
    link: int,
    name: str,
    radii: tuple[float, float],
    height: float,
    pieces: int,
    density: float,
    color: Colour,
) -> None:
    """A ring about a link's z of boxes that stand on its frame, the first towards x, between two radii [m].

    They meet at their inner edges: what they overlap by outside counts once, by the mean width of a sector.
    """
    for i, (wide, place, turn, sector) in enumerate(ring_boards(radii, height, pieces), 1):
        body.solid(link, f"{name}_{i}", wide, place, density, color, turn, filled=sector)


def ring_boards(radii: tuple[float, float], height: float, pieces: int) -> Iterator[tuple[Box, Vec3, Quat, Box]]:
    """Boards of `ring` with their places and turns, and what of each counts."""
    inner, outer = radii
    wall, middle = outer - inner, (inner + outer) / 2
    wide = Box((wall / 2, outer * tan(pi / pieces), height / 2))
    sector = Box((wall / 2, middle * tan(pi / pieces), height / 2))
    for i in range(pieces):
        angle = 2 * pi * i / pieces
        yield wide, (middle * cos(angle), middle * sin(angle), height / 2), turned((0.0, 0.0, 1.0), angle), sector


def flared_boards(foot: float, rim: float, height: float, wall: float, pieces: int) -> Iterator[tuple[Box, Vec3, Quat]]:
    """The wall of a vessel [m] about z, from the edge of its floor, `wall` thick, to its rim: boards, radii inside."""
    out, up = rim - foot, height - wall
    lean = atan2(out, up)
    middle = ((rim + foot) / 2 + wall / 2 * cos(lean), (height + wall) / 2 - wall / 2 * sin(lean))
    board = Box((wall / 2, max(rim, foot) * tan(pi / pieces), hypot(out, up) / 2))
    leaning = P.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.array(lean))
    for i in range(pieces):
        angle = 2 * pi * i / pieces
        turn = P.multiply(P.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.array(angle)), leaning)
        x, y, z, w = turn.tolist()
        yield board, (middle[0] * cos(angle), middle[0] * sin(angle), middle[1]), (x, y, z, w)
