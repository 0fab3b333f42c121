"""Bodies that fields are fixed to, or push, by name."""

from anysim.conventions import WORLD, Array
from anysim.errors import listing
from anysim.families.base import FamilySetting
from anysim.randomization.draw import draw_rows


def must_collide(setting: FamilySetting, body: int, met: Array, key: str) -> None:
    """Raise SpecError where a body is none of those that get forces: those that move and collide."""
    bodies = setting.engine.world.bodies
    if body not in met:
        solid = {geom.body for geom in setting.engine.world.geoms if geom.collides and geom.body != WORLD}
        raise setting.fault(
            key,
            f"'{bodies[body].name}' has no shape that collides or does not move; forces act on bodies that do (there "
            f"are: {listing([bodies[i].name for i in sorted(solid)])})",
        )


def drawn(setting: FamilySetting, value: object, key: str, env_ids: Array) -> Array:
    """A parameter as it is in the episodes of these envs, one row each."""
    path, stream = f"world.families.{setting.name}.{key}", f"family/{setting.name}/{key}"
    return draw_rows(value, stream, setting.streams, env_ids, source=path)
