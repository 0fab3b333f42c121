"""FamilyManager: the families of a world through the life of its envs, and all that they remember."""

from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.engine.cameras import CameraView
from anysim.engine.capability import Need
from anysim.engine.snapshots.row_checks import refuse_range
from anysim.errors import NameLookupError, PluginError, listing, suggest
from anysim.families.base import Family, FamilySetting, FamilyState
from anysim.managers.base import Manager
from anysim.model.world import World
from anysim.plugin_parameters import checked
from anysim_schemas.base import Spec

FamilyKind = TypeVar("FamilyKind", bound=Family)


class FamilyManager(Manager):
    """What lives beside the engine: asked before and after the engine moves on."""

    name = "families"

    def build(self, world: World) -> None:
        self._kinds: dict[str, type[Family]] = {}
        self._settings: dict[str, tuple[Spec, tuple[int, ...]]] = {}
        for name, spec in (self.spec.world.families or {}).items():
            made = registry.load("families", spec.kind)
            if not (isinstance(made, type) and issubclass(made, Family)):
                raise PluginError(
                    f"the family '{spec.kind}' of {registry.origin(made)} is no Family; derive it from "
                    f"anysim.families.base.Family"
                )
            values = checked(made.spec, spec.params, f"world.families.{name}")
            assert isinstance(values, Spec)
            own = tuple(i for i, one in enumerate(world.entities) if (one.family, one.category) == (spec.kind, name))
            self._kinds[name], self._settings[name] = made, (values, own)
        self._everyone = np.arange(self.streams.num_envs)

    def needs(self) -> Iterable[Need]:
        for name, kind in self._kinds.items():
            for capability in kind.needs:
                yield Need(capability, f"family '{name}'", f"world.families.{name}")

    def bind(self, engine: SimEngine) -> None:
        super().bind(engine)
        self._families: dict[str, Family] = {}
        self._blames: dict[str, registry.Blame] = {}
        for name, kind in self._kinds.items():
            who = f"{self.located(f'world.families.{name}')}: the family '{name}'"
            self._blames[name] = registry.Blame(who, registry.origin(kind), prefix=True)
            values, own = self._settings[name]
            with self._blames[name]:
                self._families[name] = kind(
                    FamilySetting(name, values, engine, self.streams, own, self.episodes.origin)
                )
        for name, family in self._families.items():
            with self._blames[name]:
                family.joined([*self._families.values()])
        self._by_step = [name for name, family in self._families.items() if family.rate == "physics"]
        self._by_part = [name for name in self._families if name not in self._by_step]
        self._dt = engine.world.physics.dt
        self._drawn = [name for name, family in self._families.items() if family.drawn]
        if self._drawn:
            engine.overlays.append(self._draw)

    # ------------------------------------------------------------------ episodes

    def reset(self, env_ids: Array) -> None:
        for name, family in self._families.items():
            for array in family.memory.values():
                array[env_ids] = 0
            with self._blames[name]:
                family.reset(env_ids)

    def advance(self, steps: int, ids: Array | None, keep_wrench: bool) -> None:
        """`steps` physics steps of these envs (None: of all) with the families beside them; as `SimEngine.step`."""
        which, duration = self._everyone if ids is None else ids, steps * self._dt
        self._ask(self._by_part, which, duration, before=True)
        if self._by_step:
            for left in range(steps - 1, -1, -1):
                self._ask(self._by_step, which, self._dt, before=True)
                self.engine.step(1, ids, keep_wrench=keep_wrench or left > 0)
                self._ask(self._by_step, which, self._dt, before=False)
        else:
            self.engine.step(steps, ids, keep_wrench=keep_wrench)
        self._ask(self._by_part, which, duration, before=False)

    def _ask(self, names: Iterable[str], env_ids: Array, duration: float, *, before: bool) -> None:
        for name in names:
            family = self._families[name]
            with self._blames[name]:
                (family.before_step if before else family.after_step)(env_ids, duration)

    def _draw(self, env_ids: Array, view: CameraView, images: Mapping[str, Array]) -> None:
        for name in self._drawn:
            with self._blames[name]:
                self._families[name].draw(env_ids, view, images)

    def fault(self, env_ids: Array) -> Array:
        """(n,) bool: envs in which the matter of a family is beyond repair."""
        found = np.zeros(len(env_ids), dtype=bool)
        for name, family in self._families.items():
            with self._blames[name]:
                found |= family.fault(env_ids)
        return found

    # ------------------------------------------------------------------ what there is to see

    def family(self, name: str) -> Family:
        """A family by its name in `world.families`.

        Raises:
            NameLookupError: lists the families.
        """
        if name not in self._families:
            known = f"{suggest(name, list(self._families))} (families: {listing(self._families)})"
            raise NameLookupError(f"there is no family '{name}'{known}")
        return self._families[name]

    def of_kind(self, kind: type[FamilyKind]) -> list[FamilyKind]:
        """The families of a class, in the order of the file."""
        return [family for family in self._families.values() if isinstance(family, kind)]

    def state(self, name: str, env_ids: Array | None = None) -> FamilyState:
        """What a family looks like in these envs, or in all."""
        family = self.family(name)
        with self._blames[name]:
            return family.state(self._everyone if env_ids is None else env_ids)

    def points(self, name: str) -> Callable[[Array], FamilyState] | None:
        """What gives the state of a family of matter in some envs; None where the name is of no such family."""
        return self._families[name].state if name in self._drawn else None

    def facts(self, env: int) -> dict[str, Mapping[str, object]]:
        """What the families of an env say of their entities, by entity."""
        found: dict[str, Mapping[str, object]] = {}
        for name, family in self._families.items():
            with self._blames[name]:
                found |= family.facts(env)
        return found

    def recorded(self, env_ids: Array) -> dict[str, Array]:
        """What is recorded of these envs, `family_NAME_FIELD` (n, …)."""
        found: dict[str, Array] = {}
        for name, family in self._families.items():
            with self._blames[name]:
                found |= {f"family_{name}_{key}": np.array(rows) for key, rows in family.recorded(env_ids).items()}
        return found

    # ------------------------------------------------------------------ snapshots

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {key: array[env_ids] for key, array in self._memory().items()}

    def _memory(self) -> dict[str, Array]:
        return {f"{name}.{key}": array for name, f in self._families.items() for key, array in f.memory.items()}

    def refuse_rows(self, data: Mapping[str, Array]) -> None:
        for name, family in self._families.items():
            for key, (low, high) in family.bounds.items():
                refuse_range(f"{name}.{key}", data[f"{name}.{key}"], low, high)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        for key, array in self._memory().items():
            array[env_ids] = data[key]
