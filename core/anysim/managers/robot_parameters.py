"""Robot parameters: what the drives, joints and links of a robot are like in this episode."""

from collections.abc import Iterator, Sequence

import numpy as np

from anysim.compile.dynamics import (
    ADJUSTMENTS,
    Adjustment,
    adjusted_indices,
    find_payload,
    inertial_arrays,
    loaded,
    moving_links,
    touching_geoms,
)
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.kinematics import inertia
from anysim.model.world import World
from anysim.randomization.distributions import nominal
from anysim.randomization.draw import draw_rows, is_random
from anysim.randomization.streams import Streams
from anysim_schemas.dynamics import RobotDynamicsSpec


class RobotParameters:
    """One robot. The World has the nominal values; what is drawn replaces them, relative to the catalogue's."""

    def __init__(self, world: World, name: str, spec: RobotDynamicsSpec, streams: Streams) -> None:
        self._world, self._name, self._spec, self._streams = world, name, spec, streams
        self._entity = next(e for e in world.entities if e.name == name)
        self._adjustments = [a for a in ADJUSTMENTS if self._random(a.scale) or self._random(a.offset)]
        self._heavy = self._random("mass_scale")
        self._payload = None if spec.payload is None else find_payload(world, name, spec.payload)
        self._laden = spec.payload is not None and is_random(spec.payload.mass)

    def _random(self, field: str | None) -> bool:
        return field is not None and is_random(getattr(self._spec, field))

    def parameters(self) -> Iterator[tuple[str, str]]:
        """See `Manager.parameters`."""
        path = f"world.robots.{self._name}.dynamics"
        for a in self._adjustments:
            yield a.parameter, f"{path}.{a.scale if self._random(a.scale) else a.offset}"
        if self._heavy:
            yield from ((name, f"{path}.mass_scale") for name in ("body.mass", "body.inertia"))
        if self._laden:
            yield "body.mass", f"{path}.payload.mass"
            if self._payload is not None and self._payload.point is not None:
                yield from ((name, f"{path}.payload.position") for name in ("body.com", "body.inertia"))
        if self._random("link_friction_scale"):
            yield "geom.friction", f"{path}.link_friction_scale"

    def write(self, engine: SimEngine, env_ids: Array) -> None:
        """Draw for these envs."""
        for adjustment in self._adjustments:
            self._adjust(engine, adjustment, env_ids)
        if self._heavy or self._laden:
            self._weigh(engine, env_ids)
        if self._random("link_friction_scale"):
            geoms = touching_geoms(self._world, self._entity)
            built = np.array([self._world.geoms[i].surface.friction for i in geoms])
            names = [self._world.geoms[i].name for i in geoms]
            rows = self._relative("link_friction_scale", names, env_ids) * built
            engine.set_parameters("geom.friction", rows, env_ids, geoms)

    def _adjust(self, engine: SimEngine, adjustment: Adjustment, env_ids: Array) -> None:
        indices = adjusted_indices(self._world, self._entity, adjustment)
        if not indices:
            return
        things = [getattr(self._world, adjustment.target)[i] for i in indices]
        names = [thing.name for thing in things]
        values = np.array([getattr(thing, adjustment.field) for thing in things], dtype=float)
        rows = np.broadcast_to(values, (len(env_ids), len(indices)))
        if adjustment.offset is not None:
            rows = rows - float(nominal(getattr(self._spec, adjustment.offset)))
        rows = rows * self._relative(adjustment.scale, names, env_ids)
        if adjustment.offset is not None:
            rows = np.maximum(rows + self._drawn(adjustment.offset, names, env_ids), 0.0)
        engine.set_parameters(adjustment.parameter, rows, env_ids, indices)

    def _weigh(self, engine: SimEngine, env_ids: Array) -> None:
        """Masses, centres of mass and inertias of the links: those of the World without its payload, scaled, laden."""
        bodies = moving_links(self._world, self._entity)
        factors = self._relative("mass_scale", [self._world.bodies[b].name for b in bodies], env_ids)
        spec, place = self._spec.payload, self._payload
        masses = np.zeros(len(env_ids))
        if spec is not None:
            masses = draw_rows(
                spec.mass,
                f"robot/{self._name}/payload",
                self._streams,
                env_ids,
                source=f"world.robots.{self._name}.dynamics.payload.mass",
            )
        point = None if place is None else place.point
        plain = [self._world.bodies[b].inertial for b in bodies]
        carrier = bodies.index(place.body) if place is not None else -1
        if spec is not None:
            plain[carrier] = loaded(plain[carrier], -float(nominal(spec.mass)), point)
        rows = []
        for row in range(len(env_ids)):
            links = [inertia.scaled(p, float(f)) if f != 1.0 else p for p, f in zip(plain, factors[row], strict=True)]
            if spec is not None:
                links[carrier] = loaded(links[carrier], float(masses[row]), point)
            rows.append(inertial_arrays(links))
        mass, com, moments = (np.stack(part) for part in zip(*rows, strict=True))
        engine.set_parameters("body.mass", mass, env_ids, bodies)
        if point is not None and self._laden:
            engine.set_parameters("body.com", com, env_ids, bodies)
        if self._heavy or point is not None:
            engine.set_parameters("body.inertia", moments, env_ids, bodies)

    def _relative(self, field: str, names: Sequence[str], env_ids: Array) -> Array:
        """Factors (E, K) of the World's values, which have the nominal factor already."""
        return self._drawn(field, names, env_ids) / float(nominal(getattr(self._spec, field)))

    def _drawn(self, field: str, names: Sequence[str], env_ids: Array) -> Array:
        """Draws (E, K) of a field: one for all, or one for each name."""
        value, stream = getattr(self._spec, field), f"robot/{self._name}/{field}"
        source = f"world.robots.{self._name}.dynamics.{field}"
        if not (self._spec.independent and is_random(value)):
            one = draw_rows(value, stream, self._streams, env_ids, source=source)
            return np.repeat(one[:, None], len(names), axis=1)
        short = [name.removeprefix(f"{self._name}.") for name in names]
        rows = [draw_rows(value, f"{stream}/{name}", self._streams, env_ids, source=source) for name in short]
        return np.stack(rows, axis=1)
