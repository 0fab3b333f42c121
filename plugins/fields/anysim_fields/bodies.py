"""Bodies that fields are fixed to, or push, by name."""

from anysim.conventions import WORLD, Array
from anysim.errors import PluginError, listing
from anysim.families.base import FamilySetting
from anysim.randomization.draw import draw_rows


def body_of(setting: FamilySetting, name: str | None, key: str) -> int:
    """The body that is called so, or the root of the object; WORLD of no name."""
    if name is None:
        return WORLD
    world = setting.engine.world
    if name in world.entity_numbers:
        return int(world.entities[world.entity_numbers[name]].root)
    names = [body.name for body in world.bodies]
    if name not in names:
        raise PluginError(
            f"world.families.{setting.name}.{key}: there is no body or object '{name}' ({listing(names)})"
        )
    return names.index(name)


def must_collide(setting: FamilySetting, body: int, met: Array, key: str) -> None:
    """Raise PluginError where a body is none of those that get forces: those that move and collide."""
    bodies = setting.engine.world.bodies
    if body not in met:
        solid = {geom.body for geom in setting.engine.world.geoms if geom.collides and geom.body != WORLD}
        raise PluginError(
            f"world.families.{setting.name}.{key}: '{bodies[body].name}' has no shape that collides or does not move; "
            f"forces act on bodies that do (there are: {listing([bodies[i].name for i in sorted(solid)])})"
        )


def drawn(setting: FamilySetting, value: object, key: str, env_ids: Array) -> Array:
    """A parameter as it is in the episodes of these envs, one row each."""
    path, stream = f"world.families.{setting.name}.{key}", f"family/{setting.name}/{key}"
    return draw_rows(value, stream, setting.streams, env_ids, source=path)
