"""Bindings: what `collect` draws by name for an episode, and `$name` in the parameters of commands and terms.

A parameter that says `$name` has another value in each episode. What it is a parameter of is therefore made once for
each of the values that it can have, and each env uses the one whose value was drawn.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from math import prod
from typing import Any, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.snapshots.row_checks import refuse_range
from anysim.errors import SpecError, SpecIssue, listing, suggest
from anysim.randomization.draw import draw
from anysim.randomization.streams import Streams
from anysim.task.scene import SceneView
from anysim.task.term_registry import bind
from anysim_schemas.collect import BoundRange, ChooseSpec, CollectSpec, RepeatSpec
from anysim_schemas.plugin import BOUND, bound_names
from anysim_schemas.task import TermSpec
from anysim_schemas.values import Choice

MOST_VARIANTS = 256
"""How many combinations of values the parameters of one command or term may have."""


class Variants(NamedTuple):
    """Parameters with every combination of the values that they can have.

    Attributes:
        names: the bindings that they refer to.
        params: the parameters, one mapping for each combination, the last name turning fastest.
    """

    names: tuple[str, ...]
    params: Sequence[Mapping[str, Any]]


class Bindings:
    """The values that are drawn for the present episode of each env.

    Attributes:
        values: what each name can be.
        index: (N,) which of them it is, by name. A choice among commands is there under its path in the file.
    """

    def __init__(self, collect: CollectSpec | None, num_envs: int, streams: Streams) -> None:
        self._streams = streams
        bound: Mapping[str, Any] = {} if collect is None else collect.bind
        choices = {} if collect is None else dict(_choices(collect.commands, "collect.commands"))
        self._specs = {
            name: (value.choice if isinstance(value, BoundRange) else value, f"collect.bind.{name}")
            for name, value in bound.items()
        }
        self._specs |= {path: (value, path) for path, value in choices.items()}
        self.values: dict[str, tuple[Any, ...]] = {
            name: value.choice if isinstance(value, Choice) else (value,) for name, (value, _) in self._specs.items()
        }
        self.index = {name: np.zeros(num_envs, dtype=np.int64) for name in self._specs}
        self._names = tuple(bound)

    def draw(self, env_ids: Array) -> None:
        """Draw anew for envs whose episodes begin."""
        for name, (value, source) in self._specs.items():
            stream = f"collect/{source.removeprefix('collect.')}"
            for env in env_ids.tolist():
                drawn = draw(value, stream, self._streams, env, source=source)
                same = (k for k, one in enumerate(self.values[name]) if one == drawn and type(one) is type(drawn))
                self.index[name][env] = next(same)

    def rows(self) -> dict[str, tuple[Array, Array]]:
        """By bound name its values as rows of numbers (V, k), and which of them each env has (N,), kept up to date.

        A number is itself; what is no number has one column for each value.
        """
        return {name: (_numbers(self.values[name]), self.index[name]) for name in self._names}

    def variants(self, params: Mapping[str, Any], path: str) -> Variants:
        """The parameters at a path of the file with every combination of the values that they refer to.

        Raises:
            SpecError: at the key, a name that is not bound; at the path, too many combinations.
        """
        names: dict[str, None] = {}
        for key, value in params.items():
            for name in bound_names(value):
                if name not in self._names:
                    words = f"'${name}' is not bound{suggest(name, self._names)}; collect.bind has "
                    raise SpecError([SpecIssue("", f"{path}.{key}", words + listing(self._names))])
                names[name] = None
        count = prod(len(self.values[name]) for name in names)
        if count > MOST_VARIANTS:
            words = f"{listing([f'${name}' for name in names])} have {count} combinations, at most {MOST_VARIANTS}"
            raise SpecError(
                [SpecIssue("", path, f"{words} are possible: choose among fewer values, or of ranges fewer `steps`")]
            )
        combinations = product(*(self.values[name] for name in names))
        every = [_filled(params, dict(zip(names, values, strict=True))) for values in combinations]
        return Variants(tuple(names), every)

    def which(self, names: Sequence[str], env_ids: Array) -> Array:
        """(n,) the number of the variant, in the order of `Variants.params`, that is drawn in these envs."""
        number = np.zeros(len(env_ids), dtype=np.int64)
        for name in names:
            number = number * len(self.values[name]) + self.index[name][env_ids]
        return number

    def said(self, text: str, env: int) -> str:
        """A text with the values of an env's episode in place of `$name`; what is not bound stays as it is."""
        if "$" not in text:
            return text
        return BOUND.sub(lambda found: str(self._value(found[1], env)) if found[1] in self._names else found[0], text)

    def _value(self, name: str, env: int) -> Any:
        return self.values[name][self.index[name][env]]

    def snapshot(self, env_ids: Array) -> dict[str, Array]:
        """Copies of what is drawn."""
        return {f"bound.{name}": index[env_ids] for name, index in self.index.items()}

    def refuse_rows(self, data: Mapping[str, Array]) -> None:
        """Raise SnapshotError for values that no env can have."""
        for name, values in self.values.items():
            refuse_range(f"bound.{name}", data[f"bound.{name}"], 0, len(values) - 1)

    def restore(self, env_ids: Array, data: Mapping[str, Array]) -> None:
        """Write what `snapshot` returned."""
        for name, index in self.index.items():
            index[env_ids] = data[f"bound.{name}"]


def bind_term(
    kind: str, spec: TermSpec, scene: SceneView, path: str, bindings: Bindings | None = None
) -> Callable[..., Any]:
    """The term as a function of its positional arguments after `scene`; in each env with the values drawn there.

    Raises:
        SpecError: at the key, a parameter that is wrong, names nothing in this world, or is not bound.
    """
    if not any(bound_names(spec.params)):
        return bind(kind, spec.term, spec.params, scene, path)
    variants = (bindings or Bindings(None, 1, Streams(1))).variants(spec.params, path)
    if kind == "event":
        raise SpecError([SpecIssue("", path, f"an event cannot refer to what is bound: it says ${variants.names[0]}")])
    assert bindings is not None
    calls = [bind(kind, spec.term, params, scene, path) for params in variants.params]

    def chosen(*arguments: Any) -> Array:
        which = bindings.which(variants.names, scene.env_ids)
        drawn, number = np.unique(which, return_inverse=True)
        said = np.stack([calls[k](*arguments) for k in drawn])
        return said[number, np.arange(len(which))]

    return chosen


def _choices(entries: Any, path: str) -> Iterator[tuple[str, Choice[int]]]:
    """The choices among commands, by path."""
    for key, entry in enumerate(entries) if isinstance(entries, tuple) else ((None, entries),):
        here = path if key is None else f"{path}.{key}"
        if isinstance(entry, ChooseSpec):
            yield here, Choice[int](choice=tuple(range(len(entry.choose))), weights=entry.weights)
            for number, branch in enumerate(entry.choose):
                yield from _choices(branch, f"{here}.choose.{number}")
        elif isinstance(entry, RepeatSpec):
            yield from _choices(entry.body, f"{here}.body")


def _numbers(values: Sequence[Any]) -> Array:
    """(V, 1) the values, or (V, V) one column for each."""
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array(values, dtype=float)[:, None]
    return np.eye(len(values))


def _filled(value: Any, values: Mapping[str, Any]) -> Any:
    """A parameter with values in place of names: the value itself where the whole text is one name."""
    if isinstance(value, str):
        whole = BOUND.fullmatch(value)
        return values[whole[1]] if whole else BOUND.sub(lambda found: str(values[found[1]]), value)
    if isinstance(value, Mapping):
        return {key: _filled(item, values) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_filled(item, values) for item in value]
    return value
