"""Protocols: files of benchmarks, and shipped ones by name."""

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from anysim.api import resolve_options
from anysim.errors import SpecError, SpecIssue, TaskError, listing
from anysim_evaluation.driver import episode_seeds
from anysim_schemas.benchmark import BenchmarkSpec, BenchmarkTaskSpec
from anysim_schemas.load import LoadedSpec, load


class Protocol(NamedTuple):
    """A protocol and where it is from.

    Attributes:
        loaded: the file, with the places of its keys.
        added: policies of the command line, which are not in the file.
    """

    loaded: LoadedSpec[BenchmarkSpec]
    added: Sequence[str] = ()

    @property
    def spec(self) -> BenchmarkSpec:
        """What the file says."""
        return self.loaded.spec

    @property
    def path(self) -> Path:
        """The file."""
        return self.loaded.files[-1]

    @property
    def frozen(self) -> Path:
        """The file beside it that holds what is frozen."""
        return self.path.with_suffix(".frozen.json")

    def seeds(self) -> list[int]:
        """The episodes of each task, engine and policy."""
        wanted = self.spec.seeds
        return episode_seeds(wanted.split, wanted.first, wanted.episodes)

    def source(self, task: str) -> str:
        """What `anysim.make` takes for a task: an installed one by name, or the path of a file."""
        name = self.spec.tasks[task].task
        return str(self.path.parent / name) if name.endswith((".yaml", ".yml")) else name

    def fault(self, key: str, words: str) -> SpecError:
        """The error of a key, with its place."""
        return SpecError([SpecIssue(self.loaded.provenance.get(key, ""), key, words)])


def shipped() -> dict[str, Path]:
    """The protocols that come with this package, by name."""
    folder = Path(str(files("anysim_evaluation").joinpath("benchmark/protocols")))
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def load_protocol(name: str, added: Sequence[str] = ()) -> Protocol:
    """A shipped protocol by name, or a file; `added` are further policies, `NAME=POLICY`.

    A file may say `extends: benchmark:NAME`.

    Raises:
        SpecError: every fault with file, line and column.
        TaskError: no such protocol, or a policy that is not of that form or whose name the file has.
    """
    path = Path(name) if name.endswith((".yaml", ".yml")) else _shipped_path(name)
    loaded = load(BenchmarkSpec, path, overrides=[], resolver=resolve_options, extends=_extends)
    names = [words.partition("=")[0] for words in added]
    for words, key in zip(added, names, strict=True):
        if "=" not in words or key in loaded.spec.policies:
            taken = "the protocol has a policy of that name" if "=" in words else "expected NAME=POLICY"
            raise TaskError(f"--policy {words}: {taken}, as in mine=my_policies:act")
    if added:
        overrides = [f"policies.{words}" for words in added]
        loaded = load(BenchmarkSpec, path, overrides=overrides, resolver=resolve_options, extends=_extends)
    return Protocol(loaded, tuple(names))


def _shipped_path(name: str) -> Path:
    known = shipped()
    if name not in known:
        raise TaskError(f"there is no protocol '{name}'; shipped are {listing(known)}; a file ends in .yaml")
    return known[name]


def _extends(uri: str) -> Path:
    scheme, _, name = uri.partition(":")
    if scheme != "benchmark":
        raise TaskError(f"'{uri}' cannot be extended; a path or benchmark:NAME expected")
    return _shipped_path(name)


def overrides(task: BenchmarkTaskSpec) -> list[str]:
    """The changes to a task as it is run."""
    said = [] if task.level is None else [f"level={task.level}"]
    said += [] if task.horizon is None else [f"task.horizon={task.horizon}"]
    return [*said, *task.overrides, "record.cameras=[]"]
