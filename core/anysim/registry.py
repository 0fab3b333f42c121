"""Kinds: named plugins found through entry points, imported when they are used and not before.

A kind is a group `anysim.<kind>` (engines, tasks, robots, controllers, skills, planners, writers, terms…). Two
distributions that offer one name are an error that lists both; `dist:name` chooses. What the code of a plugin raises is
told with its distribution and the remedy, whatever it is but Ctrl-C: `sys.exit` in a plugin must not end a command.
"""

from collections.abc import Generator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib import metadata
from types import MappingProxyType
from typing import Any, NoReturn, Self

from anysim.errors import AnysimError, PluginError, PluginFailure, listing, suggest

KINDS: Mapping[str, str] = {
    "engines": "physics engines",
    "tasks": "tasks (a package with a task.yaml)",
    "robots": "robots (a package with NAME.yaml)",
    "controllers": "action controllers",
    "policies": "learned policies, which the controller `policy` runs",
    "env_policies": "policies of whole envs, which `anysim evaluate` runs",
    "benchmarks": "external benchmarks, whose tasks `anysim evaluate BENCHMARK:TASK` runs",
    "learners": "learners, which `anysim train` runs",
    "terms": "libraries of observation, reward, predicate, command and event terms",
    "skills": "skills",
    "sensors": "sensors",
    "annotators": "annotators, which label what cameras see",
    "renderings": "what `anysim render` makes besides videos",
    "planners": "planners",
    "families": "families: what things and people are made of, and who moves them",
    "exporters": "exporters, which write recorded runs as data sets (`anysim export`)",
    "clients": "clients of services, by the scheme of an address, for `anysim.connect`",
    "executors": "executors, which step envs, or do the jobs of long commands, elsewhere",
    "devices": "input devices, with which people drive robots",
    "writers": "record writers",
    "streams": "streams of records, which `record.streams` asks for",
    "readers": "record readers, by the writer's name",
    "importers": "asset importers, by file format",
    "scenes": "readers of whole scene files as worlds, by file format",
    "model_writers": "writers of models as files of other programs, by file format",
    "oracles": "independent readers of robots that importers are held against, by file format",
    "assets": "builders of procedural assets",
    "colliders": "makers of collision geometry from meshes, other than their hulls",
    "layouts": "proposers of layouts",
    "rooms": "builders of rooms",
    "terrains": "builders of generated ground",
    "textures": "patterns of procedural textures",
    "views": "views of envs, which `anysim run --view` opens",
    "vocabularies": "words for things and deeds (a package with NAME.yaml)",
}
"""The kinds that anysim looks up, and what each is."""

_OFFERS: Mapping[str, Mapping[str, str]] = {
    "anysim-adapters": {"commands": "openenv openpi"},
    "anysim-agents": {"commands": "mcp"},
    "anysim-annotation": {
        "annotators": "affordance boxes_2d boxes_3d camera depth eef_waypoint flow instance nav_point normals obj_bbox"
        " point_cloud semantic skeleton",
        "exporters": "coco",
        "renderings": "annotations stills",
        "streams": "annotations",
    },
    "anysim-app": {"commands": "app"},
    "anysim-assets": {
        "assets": "cabinet hinge_box mug parallel_gripper valve",
        "rooms": "furnished",
        "terrains": "generated",
        "textures": "brick checker dots gradient noise stripes wood",
    },
    "anysim-avatars": {"families": "avatar"},
    "anysim-banks": {"commands": "bank"},
    "anysim-bench": {"commands": "bench"},
    "anysim-cameras": {
        "controllers": "camera_follow camera_gimbal camera_motion camera_path",
        "skills": "fly_look fly_orbit fly_to fly_track watch",
    },
    "anysim-client": {"clients": "http https"},
    "anysim-collect": {"commands": "counterfactual report run"},
    "anysim-colliders": {"colliders": "decompose mesh primitives"},
    "anysim-control": {
        "controllers": "ackermann_drive batched_ik differential_drive differential_ik"
        " gripper_multi_finger holonomic_drive mink_ik operational_space pd pink_ik planar_drive",
        "planners": "numba_ik",
    },
    "anysim-evaluation": {
        "benchmarks": "gymnasium-robotics",
        "commands": "benchmark evaluate",
        "env_policies": "expert random zero",
    },
    "anysim-export": {"commands": "export tape", "exporters": "lerobot rerun rlds-ready robomimic webdataset"},
    "anysim-export-model": {"commands": "export-model"},
    "anysim-film": {"commands": "render"},
    "anysim-inspect": {"commands": "audit check doctor explain list replay snapshot verify"},
    "anysim-language": {"commands": "describe vqa", "streams": "language", "vocabularies": "english"},
    "anysim-learning": {"commands": "curves train", "learners": "clone rsl-rl sb3-ppo"},
    "anysim-maniskill": {"benchmarks": "maniskill", "commands": "verdicts"},
    "anysim-mcap": {"exporters": "foxglove", "readers": "mcap", "streams": "cameras", "writers": "mcap"},
    "anysim-mujoco": {"engines": "mujoco", "importers": "mjcf", "oracles": "mjcf", "scenes": "mjcf"},
    "anysim-navigation": {"commands": "map", "planners": "dynamic_window"},
    "anysim-parity": {"commands": "compare picture"},
    "anysim-policy": {"controllers": "policy", "env_policies": "file lerobot openpi"},
    "anysim-planning": {"commands": "retarget", "planners": "roboplan rrt threads"},
    "anysim-pybullet": {"engines": "pybullet"},
    "anysim-ray": {"executors": "ray"},
    "anysim-robots": {"commands": "gallery robot"},
    "anysim-sapien": {"engines": "sapien"},
    "anysim-sensors": {"sensors": "contact depth force_torque heights imu joints lidar occupancy tracking"},
    "anysim-serving": {"commands": "serve"},
    "anysim-sharded": {"executors": "processes"},
    "anysim-skills": {"skills": "pick"},
    "anysim-tactile": {"sensors": "tactile_fingertip tactile_pad tactile_probe"},
    "anysim-teleop": {"commands": "teleop", "devices": "browser keyboard script"},
    "anysim-urdf": {"importers": "sdf urdf world xacro", "scenes": "sdf world"},
    "anysim-usd": {"importers": "usd usda usdc usdz", "model_writers": "usd", "scenes": "usd usda usdc usdz"},
    "anysim-viewer": {"commands": "view", "views": "page"},
}
INSTALL_HINTS: Mapping[tuple[str, str], str] = {
    (kind, name): package
    for package, kinds in _OFFERS.items()
    for kind, names in kinds.items()
    for name in names.split()
}
"""Where well-known plugins come from, for the remedy in an error."""


@cache
def _scan() -> Mapping[str, tuple[metadata.EntryPoint, ...]]:
    """Our entry points by group, read once: finding those of one group takes as long as finding all."""
    found = metadata.entry_points()
    return {group: tuple(found.select(group=group)) for group in found.groups if group.partition(".")[0] == "anysim"}


@cache
def _entries(kind: str) -> Mapping[str, tuple[metadata.EntryPoint, ...]]:
    table: dict[str, list[metadata.EntryPoint]] = {}
    for entry in _scan().get(f"anysim.{kind}", ()):
        known = table.setdefault(entry.name, [])
        if not any(package_of(entry) == package_of(other) and entry.value == other.value for other in known):
            known.append(entry)
    return {name: tuple(table[name]) for name in sorted(table)}


def observers() -> tuple[metadata.EntryPoint, ...]:
    """The entry points of the modules whose hooks look at runs (see `anysim.hooks`)."""
    return _scan().get("anysim", ())


@cache
def participants() -> Mapping[str, metadata.Distribution]:
    """The installed distributions that offer something to anysim, itself among them, by name."""
    entries = (entry for entries in _scan().values() for entry in entries)
    found = {id(entry.dist): entry.dist for entry in entries}  # a name is read from a file: once for each of them
    return MappingProxyType({dist.name: dist for dist in found.values() if dist is not None})


def package_of(entry: metadata.EntryPoint) -> str:
    """The name of the distribution that an entry point comes from."""
    return entry.dist.name if entry.dist is not None else "unknown distribution"


def _one(kind: str) -> str:
    """What one of a kind is called."""
    return f"{kind[:-3]}y" if kind.endswith("ies") else kind.removesuffix("s")


def refresh() -> None:
    """Forget what was found; the next look-up reads the installed distributions again."""
    participants.cache_clear()
    _home.cache_clear()
    _entries.cache_clear()
    _scan.cache_clear()


def names(kind: str) -> list[str]:
    """The names installed for a kind, sorted. Imports nothing."""
    return list(_entries(kind))


def entry(kind: str, name: str) -> metadata.EntryPoint:
    """The entry point of `name` or `dist:name`.

    Raises:
        PluginError: unknown (lists what is installed) or ambiguous (lists the distributions).
    """
    dist, _, bare = name.rpartition(":")
    found = list(_entries(kind).get(bare, ()))
    if dist:
        found = [e for e in found if package_of(e) == dist]
    if not found:
        installed = names(kind)
        package = INSTALL_HINTS.get((kind, bare))
        remedy = f"; it comes with the package {package}: pip install {package}" if package else ""
        raise PluginError(
            f"no {_one(kind)} named '{name}' is installed{suggest(bare, installed)}{remedy} "
            f"(installed: {listing(installed)})"
        )
    if len(found) > 1:
        offers = ", ".join(f"{package_of(e)}:{bare}" for e in found)
        raise PluginError(f"the {_one(kind)} '{bare}' is offered twice; choose one of {offers}")
    return found[0]


def distribution(kind: str, name: str) -> str:
    """The distribution that offers the plugin."""
    return package_of(entry(kind, name))


def first_package(kind: str, name: str) -> str:
    """The distribution that offers the plugin; the first one where it is offered twice."""
    found = _entries(kind).get(name.rpartition(":")[2], ())
    return package_of(found[0]) if found else "unknown distribution"


def load(kind: str, name: str) -> Any:
    """Import and return the plugin's object.

    Raises:
        PluginError: unknown, ambiguous, or its import failed (names the distribution and the cause).
    """
    found = entry(kind, name)
    try:
        return found.load()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise PluginError(
            f"the {_one(kind)} '{name}' of {package_of(found)} does not load: "
            f"{in_words(error)} (entry point {found.value}); {remedy(package_of(found))}"
        ) from error


# ---------------------------------------------------------------------- what the code of plugins raises


def in_words(error: BaseException) -> str:
    """The type and the message of an error; for a plugin that ended the program, that it did."""
    text = str(error)
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def remedy(package: str) -> str:
    """What to do about a distribution that is at fault, or a module that none offers."""
    if package.startswith("module "):
        return f"repair the {package}"
    return f"repair the package {package} (pip install --upgrade {package}), or remove it: pip uninstall {package}"


def origin(thing: object) -> str:
    """The distribution that a function, a class or an object of one comes from, else its module."""
    while (inner := getattr(thing, "func", None)) is not None:  # of functools.partial
        thing = inner
    return _home(str(getattr(thing, "__module__", None) or type(thing).__module__))


def culprit(error: BaseException) -> str:
    """The distribution whose code raised an error: that of the innermost frame that belongs to any of ours."""
    trace, found = error.__traceback__, ""
    while trace is not None:
        home = _home(str(trace.tb_frame.f_globals.get("__name__", "")))
        found, trace = home if not home.startswith("module ") else found, trace.tb_next
    return found


@cache  # the name of a distribution is read from a file each time
def _home(module: str) -> str:
    top = module.partition(".")[0]
    for entries in _scan().values():
        for entry in entries:
            if entry.value.partition(":")[0].strip().partition(".")[0] == top:
                return package_of(entry)
    return "anysim" if top in ("anysim", "anysim_schemas") else f"module {module}"


def blame(error: BaseException, who: str, package: str, *, prefix: bool = False) -> NoReturn:
    """Raise what the code of a plugin raised, as a sentence that begins with `who` and names the distribution.

    Ctrl-C and the errors of anysim stay what they are; with `prefix` the latter begin with `who` too.
    """
    if isinstance(error, AnysimError):
        if prefix and not getattr(error, "issues", ()):
            error.args = (f"{who}: {error}", *error.args[1:])
        raise error
    if isinstance(error, KeyboardInterrupt):
        raise error
    raise PluginFailure(f"{who} of {package} failed: {in_words(error)}; {remedy(package)}") from error


class Blame:
    """Call the code of a plugin within it: what that raises is told as `blame` does. May be entered again and again."""

    __slots__ = ("package", "prefix", "who")

    def __init__(self, who: str, package: str, *, prefix: bool = False) -> None:
        self.who, self.package, self.prefix = who, package, prefix

    def __enter__(self) -> None:
        """Nothing is done where nothing is raised."""

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is not None:
            blame(error, self.who, self.package, prefix=self.prefix)


class Blames:
    """As `Blame`, for several calls in turn: what is raised is `current`'s."""

    __slots__ = ("current",)

    def __init__(self) -> None:
        self.current: Blame | None = None  # none while no call has begun: Ctrl-C then stays what it is

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if self.current is not None:
            self.current.__exit__(kind, error, trace)


@contextmanager
def using(kind: str, name: str, passing: tuple[type[Exception], ...] = ()) -> Generator[None]:
    """As `Blame`, for an installed plugin by kind and name; errors of the types `passing` belong to its contract."""
    try:
        yield
    except passing:
        raise
    except BaseException as error:  # noqa: BLE001 - told in a sentence
        blame(error, f"the {_one(kind)} '{name}'", distribution(kind, name))
