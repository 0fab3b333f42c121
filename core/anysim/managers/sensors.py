"""SensorManager: when sensors are read, and how what is seen of them differs from the truth.

A reading belongs to a control step: that of the reset, and each after it that the sensor's rate divides. Between two
the last one holds. Noise, loss and delay have streams of their own (`sensor/NAME/…`): one more sensor moves no draw.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import prod

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.engine.capability import Need
from anysim.engine.snapshots.row_checks import refuse_range
from anysim.errors import AnysimError, NameLookupError, PluginError, SpecError, SpecIssue, TaskError, listing, suggest
from anysim.managers.base import Manager, Overridable, random_fields
from anysim.math import pose as P
from anysim.model.world import World
from anysim.randomization.draw import DelayLine, FieldNoise, draw_rows, longest_delay
from anysim.randomization.streams import Streams
from anysim.sensors.base import Sensor, SensorField
from anysim_schemas.sensors import SensorSpec

EVERY_SENSOR: Mapping[str, SensorField] = {"time": SensorField((), "s"), "valid": SensorField((), "1", dtype="bool")}
"""Fields of each sensor beside its own: the time since the reset that it tells of, and false where one was lost."""


class _Channel:
    """One sensor in all envs: its latest readings (N, size), and what is seen of it now."""

    def __init__(self, name: str, spec: SensorSpec, sensor: Sensor, every: int, streams: Streams, who: str) -> None:
        self.sensor, self.every = sensor, every
        self._name, self._spec, self._streams = name, spec, streams
        self.blame = registry.Blame(who, registry.origin(sensor), prefix=True)
        self.fields = {**sensor.fields, **EVERY_SENSOR}
        stops = np.cumsum([prod(field.shape) for field in self.fields.values()]).tolist()
        self.columns = dict(zip(self.fields, map(slice, [0, *stops], stops), strict=False))
        size, self._noise = stops[-1], dict[str, FieldNoise]()
        for key, noise in spec.noise.items():
            path = f"world.sensors.{name}.noise.{key}"
            if key not in sensor.fields:
                known = f"{suggest(key, list(sensor.fields))} (fields: {listing(sensor.fields)})"
                raise SpecError([SpecIssue("", path, f"the sensor has no such field{known}")])
            if not self.fields[key].dtype.startswith(("float", "uint8")):  # images are bytes
                raise SpecError([SpecIssue("", path, "the field holds whole numbers, which no noise is added to")])
            numbers = 3 if self.fields[key].unit == "xyzw" else prod(self.fields[key].shape)
            self._noise[key] = FieldNoise(noise, f"sensor/{name}/{key}", path, streams, numbers, sensor.period)
        longest = longest_delay(spec.delay)
        self._line = DelayLine(streams.num_envs, size, longest) if longest else None
        self.latest = np.zeros((streams.num_envs, size))
        self.seen = self.latest if self._line is None else self.latest.copy()

    def forget(self, env_ids: Array) -> None:
        """An episode begins: nothing has been read, and what is drawn once is drawn."""
        for array in (*self.sensor.memory.values(), self.latest, self.seen):
            array[env_ids] = 0.0
        if self._line is not None:
            name, source = f"sensor/{self._name}/delay", f"world.sensors.{self._name}.delay"
            delay = draw_rows(self._spec.delay, name, self._streams, env_ids, source=source)
            self._line.reset(env_ids, delay.astype(np.int64))
        for noise in self._noise.values():
            noise.reset(env_ids)

    def take(self, env_ids: Array, ticks: Array, time: Array) -> None:
        """A reading of these envs, at their control steps (n,) and times (n,) [s]."""
        with self.blame:
            values = self.sensor.read(env_ids)
        fields = self.sensor.fields
        found = {key: np.shape(value) for key, value in values.items()}
        if found != {key: (len(env_ids), *field.shape) for key, field in fields.items()}:
            expected = {key: field.shape for key, field in fields.items()}
            raise TaskError(f"{self.blame.who} reads {found} of {len(env_ids)} envs; of one its fields are {expected}")
        rows = np.empty((len(env_ids), self.latest.shape[1]))
        for key, field in fields.items():
            value = np.asarray(values[key], dtype=np.float64).reshape(len(env_ids), -1)
            noise = self._noise.get(key)
            if noise is not None and field.unit == "xyzw":
                turn = noise.added(np.zeros((len(env_ids), 3)), env_ids, ticks)
                value = P.multiply(value, P.from_rotation_vector(turn))
            elif noise is not None:
                value = noise.added(value, env_ids, ticks)
                if field.dtype == "uint8":
                    value = np.clip(np.rint(value), 0, 255)
            rows[:, self.columns[key]] = value
        rows[:, -2], rows[:, -1] = np.maximum(time - self.sensor.age, 0.0), 1.0
        lost = self._lost(env_ids, ticks)
        self.latest[env_ids[~lost]] = rows[~lost]
        self.latest[env_ids[lost], -1] = 0.0

    def _lost(self, env_ids: Array, ticks: Array) -> Array:
        """(n,) bool: which readings are lost; the first of an episode never is."""
        share, name = self._spec.dropout, f"sensor/{self._name}/dropout"
        if not share:
            return np.zeros(len(env_ids), dtype=bool)
        pairs = zip(env_ids.tolist(), ticks.tolist(), strict=True)
        drawn = [self._streams.shared_generator(env, name, tick).random() for env, tick in pairs]
        return (np.array(drawn) < share) & (ticks > 0)

    def show(self, env_ids: Array, ticks: Array) -> None:
        """What is seen at this control step."""
        if self._line is not None:
            self._line.write(env_ids, ticks, self.latest[env_ids])
            self.seen[env_ids] = self._line.read(env_ids, ticks)

    def state(self) -> dict[str, Array]:
        """All arrays (N, …) of it, by name."""
        arrays = {"latest": self.latest} | {f"memory.{key}": array for key, array in self.sensor.memory.items()}
        for key, noise in self._noise.items():
            arrays |= {f"{key}.bias": noise.bias, f"{key}.walk": noise.walk}
        if self._line is not None:
            arrays |= {"seen": self.seen, "delay": self._line.delay, "line": self._line.rows}
        return {f"{self._name}.{key}": array for key, array in arrays.items()}


class SensorManager(Manager):
    """The sensors of a world: reads them in their turn, and keeps what is seen of them."""

    name = "sensors"

    def build(self, world: World) -> None:
        sensors = self.spec.world.sensors or {}
        self._specs = {name: _settled(world, spec, f"world.sensors.{name}.place") for name, spec in sensors.items()}
        self._channels: dict[str, _Channel] = {}

    def needs(self) -> Iterable[Need]:
        for name, spec in self._specs.items():
            for capability in registry.load("sensors", str(spec.sensor)).needs:
                yield Need(capability, f"sensor '{name}'", f"world.sensors.{name}")

    def attach(
        self, make: Callable[[str, Mapping[str, object], str], Sensor], look: Callable[[Array | None], None]
    ) -> None:
        """Have the sensors made (of a kind, with parameters, at a path of the spec), and read each once as a trial.

        `look` turns the scene to some envs, or to all.

        Raises:
            SpecError: at their keys, what is wrong with parameters and noise.
        """
        self._look, issues = look, list[SpecIssue]()
        for name, spec in self._specs.items():
            path, control_dt = f"world.sensors.{name}", self.spec.physics.control_dt
            try:
                sensor, every = make(str(spec.sensor), spec.params, path), spec.steps(control_dt)
                sensor.period = every * control_dt
                who = f"{self.located(path)}: the sensor '{spec.sensor}'"
                self._channels[name] = _Channel(name, spec, sensor, every, self.streams, who)
            except SpecError as error:
                issues.extend(error.issues)
            except AnysimError as error:
                issues.append(SpecIssue("", path, str(error)))
        arrays = [f"sensor_{name}_{key}" for name, channel in self._channels.items() for key in channel.fields]
        if twice := sorted({array for array in arrays if arrays.count(array) > 1}):
            issues.append(SpecIssue("", "world.sensors", f"'{twice[0]}' would be recorded twice; rename a sensor"))
        if issues:
            raise SpecError(issues)
        everyone = np.arange(self.streams.num_envs)
        look(None)
        self.reset(everyone)
        self.begin(everyone)

    # ------------------------------------------------------------------ episodes

    def reset(self, env_ids: Array) -> None:
        for channel in self._channels.values():
            channel.forget(env_ids)

    def begin(self, env_ids: Array) -> None:
        """The first readings of episodes, of the settled scene, which looks at these envs."""
        for channel in self._channels.values():
            with channel.blame:
                channel.sensor.reset(env_ids)
        self.sample(env_ids)

    def sample(self, env_ids: Array) -> None:
        """A control step of these envs is over, and the scene looks at them: read those sensors whose turn it is."""
        ticks, time = self.episodes.elapsed[env_ids], self.engine.get_state().time[env_ids]
        for channel in self._channels.values():
            due = ticks % channel.every == 0
            if due.all():
                channel.take(env_ids, ticks, time)
            elif due.any():
                self._look(env_ids[due])
                channel.take(env_ids[due], ticks[due], time[due])
                self._look(env_ids)
            channel.show(env_ids, ticks)

    def overridable(self) -> Sequence[Overridable]:
        sensors = (self.spec.world.sensors or {}).items()
        return [one for name, spec in sensors for one in random_fields(f"world.sensors.{name}", spec, ["delay"])]

    # ------------------------------------------------------------------ readings

    def fields(self, name: str) -> Mapping[str, SensorField]:
        """The fields of a sensor, those of every sensor last.

        Raises:
            NameLookupError: lists the sensors.
        """
        if name not in self._channels:
            known = f"{suggest(name, list(self._channels))} (sensors: {listing(self._channels)})"
            raise NameLookupError(f"there is no sensor '{name}'{known}")
        return self._channels[name].fields

    def sensor(self, name: str) -> Sensor:
        """A sensor by its name."""
        return self._channels[name].sensor

    def reading(self, name: str, field: str, env_ids: Array | slice = slice(None)) -> Array:
        """A copy (n, …) of what is seen of a sensor's field now.

        Raises:
            NameLookupError: lists what there is.
        """
        fields = self.fields(name)
        if field not in fields:
            known = f"{suggest(field, list(fields))} (fields: {listing(fields)})"
            raise NameLookupError(f"the sensor '{name}' has no field '{field}'{known}")
        rows, kind = self._channels[name].seen[env_ids, self._channels[name].columns[field]], fields[field]
        return rows.reshape(len(rows), *kind.shape).astype(kind.dtype)

    def recorded(self, env_ids: Array) -> dict[str, Array]:
        """What is recorded of these envs, `sensor_NAME_FIELD` (n, …), in the types of the fields."""
        wanted = self._channels if self.spec.record.sensors is None else self.spec.record.sensors
        return {
            f"sensor_{name}_{key}": self.reading(name, key, env_ids) for name in wanted for key in self.fields(name)
        }

    # ------------------------------------------------------------------ snapshots

    def _state(self) -> dict[str, Array]:
        return {key: array for channel in self._channels.values() for key, array in channel.state().items()}

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        return {key: array[env_ids] for key, array in self._state().items()}

    def refuse_rows(self, data: Mapping[str, Array]) -> None:
        for name, spec in self._specs.items():
            if f"{name}.delay" in data:
                refuse_range(f"{name}.delay", data[f"{name}.delay"], 0, longest_delay(spec.delay))

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        for key, array in self._state().items():
            array[env_ids] = data[key]


def _settled(world: World, spec: SensorSpec, path: str) -> SensorSpec:
    """The spec with the kind, the frame and the noise of its place on a robot, where it has one."""
    if spec.place is None:
        return spec
    entries = [(robot.name, robot.entry) for robot in world.robots if robot.entry is not None]
    places = {f"{name}.{key}": place for name, entry in entries for key, place in entry.sensors.items()}
    if spec.place not in places:
        known = f"{suggest(spec.place, list(places))} (sensors of robots: {listing(places, 20)})"
        raise SpecError([SpecIssue("", path, f"no robot has a sensor '{spec.place}'{known}")])
    place = places[spec.place]
    try:
        registry.entry("sensors", place.kind)
    except PluginError as error:
        raise SpecError([SpecIssue("", path, f"it is a place for a {place.kind}: {error}")]) from None
    given = {"frame": spec.place, **place.params, **spec.params, "noise": {**place.noise, **spec.noise}}
    return spec.model_copy(update={"sensor": place.kind, "place": None, **given})
