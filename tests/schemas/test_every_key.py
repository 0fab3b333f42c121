"""Effects of every key of a RunSpec: a change gives another World, another episode, other files, or an error."""

import json
import re
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from pydantic import BaseModel

import anysim
from anysim import registry
from anysim.api import compile_world, load
from anysim.errors import AnysimError
from anysim.record.manifest import read_manifest
from anysim.record.names import trajectories
from anysim.skills.runner import SkillPolicy
from anysim.task.env import TaskEnv
from anysim.testing.engines import require_drawing
from anysim_recording.collector import Collector
from anysim_schemas.base import Spec
from anysim_schemas.run import RunSpec
from tests.schemas.keys import layout, run, sensors, world
from tests.schemas.keys.row import FILE, Row

HERE = Path(__file__).parent
ROWS: dict[str, Row] = {**run.ROWS, **world.ROWS, **layout.ROWS, **sensors.ROWS}
STEPS, EPISODES = 4, 3


def models(hint: Any) -> Iterator[type[BaseModel]]:
    """The specs that a field may hold."""
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        yield hint
    for part in get_args(hint):
        yield from models(part)


def declared(model: type[BaseModel], field: str) -> str:
    """`SPEC.FIELD`, of the spec that declares a field first; what a value holds is left out: Range_color is Range."""
    first = [c for c in model.__mro__ if field in vars(c).get("__annotations__", {})][-1]
    name = re.sub(r"(_[a-z_]+|\[.*)$", "", first.__name__)
    return f"{name}.{field}"


def every_key() -> set[str]:
    """The keys of the schema, in all specs that a RunSpec holds."""
    seen: set[type[BaseModel]] = set()
    open_: list[type[BaseModel]] = [RunSpec]
    while open_:
        model = open_.pop()
        if model not in seen:
            seen.add(model)
            open_ += [part for field in model.model_fields.values() for part in models(field.annotation)]
    return {declared(model, field) for model in seen for field in model.model_fields}


def test_every_key_has_a_row() -> None:
    assert every_key() - set(ROWS) == set(), "add a change of each to tests/schemas/keys"
    assert set(ROWS) - every_key() == set(), "these are no keys of the schema any more"


def test_a_new_key_needs_a_row() -> None:
    class Inner(Spec):
        depth: int = 1

    class Outer(RunSpec):
        extra: dict[str, tuple[Inner, ...]]

    assert [m.__name__ for m in models(Outer.model_fields["extra"].annotation)] == ["Inner"]
    assert declared(Outer, "extra") == "Outer.extra"
    assert declared(Outer, "num_envs") == "RunSpec.num_envs"


# ------------------------------------------------------------------ what is seen


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What files refer to: meshes, heights, an image, proposals, and a robot."""
    out = tmp_path_factory.mktemp("files")
    for folder, names in (("shapes", "abc"), ("others", "de")):
        (out / folder).mkdir()
        for number, name in enumerate(names, 1):
            (out / folder / f"{name}.obj").write_text(tetrahedron(0.05 + 0.01 * number))
        (out / folder / "one.obj").write_text(tetrahedron(0.04 + 0.0005 * ord(folder[0])))
    (out / "packed.urdf").write_text(PACKED)
    (out / "packed.sdf").write_text(PACKED_SDF)
    (out / "scene.xml").write_text(
        '<mujoco><worldbody><body name="post"><geom size="0.1"/></body></worldbody></mujoco>'
    )
    for number, name in enumerate("ab"):
        np.save(out / f"{name}.npy", np.arange(9.0).reshape(3, 3) * (0.1 + number))
    (out / "grey.bmp").write_bytes(grey_image())
    for name, x in (("plan", 0.04), ("other_plan", 0.2)):
        poses = {
            "red": {"position": [0.0, 0.0, 0.43], "quaternion": [0.08, 0.0, 0.0, 0.996795]},
            "ball": {"position": [x, 0.02, 0.44]},
        }
        (out / f"{name}.json").write_text(json.dumps({"poses": poses}))
    for name in ("keys/two_link.yaml", "../runtime/two_link.urdf"):
        text = (HERE / name).read_text().replace("file:../../runtime", f"file:{out}")
        (out / Path(name).name).write_text(text)
    return out


PACKED = """<robot name="packed"><link name="it"><inertial><mass value="1"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><mesh filename="package://toys/one.obj"/></geometry></collision></link></robot>
"""


PACKED_SDF = """<sdf version="1.9"><world><model name="it"><static>1</static><link name="l"><collision name="c">
  <geometry>
  <mesh><uri>package://toys/one.obj</uri></mesh></geometry></collision></link></model></world></sdf>
"""


def tetrahedron(edge: float) -> str:
    """An OBJ file."""
    corners = [(0, 0, 0), (edge, 0, 0), (0, edge, 0), (0, 0, edge)]
    return "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def grey_image() -> bytes:
    """A BMP file of 4 x 4 pixels, 24 bits each."""
    pixels = b"".join(bytes([value] * 3) for value in range(0, 160, 10))
    size = 54 + len(pixels)
    head = b"BM" + size.to_bytes(4, "little") + bytes(4) + (54).to_bytes(4, "little") + (40).to_bytes(4, "little")
    return head + (4).to_bytes(4, "little") * 2 + b"\x01\x00\x18\x00" + bytes(24) + pixels


def loaded(row: Row, files: Path, *, changed: bool) -> Any:
    """The blocks with what the row adds, and with its change."""
    overrides = [*row.given, *(row.change if changed else ())]
    return load(FILE, overrides=[text.replace("$FILES", str(files)) for text in overrides])


def world_of(spec: Any, _out: Path) -> Any:
    return compile_world(spec).hash


def episodes_of(spec: Any, _out: Path, *, heed: bool = True) -> Any:
    """What two envs draw, observe and earn, and where everything is."""
    out: list[Any] = []
    with anysim.make(spec, num_envs=2, curriculum=True) as env:
        for _ in range(EPISODES):
            out.append(repr(env.reset()))
            out += [repr(dict(draws)) for draws in env.streams.draws]
            for _ in range(STEPS if spec.spec.task is not None else 0):
                if not env.running.any():
                    break
                seen = env.step(np.full((2, env.action_dim), 0.3), env.running if heed else None)
                out += [repr(seen.obs), repr(seen.reward), repr(seen.status)]
            state = env.engine.get_state()
            out += [state.body_pose.tobytes(), state.joint_pos.tobytes(), state.joint_vel.tobytes()]
    return out


def stepped_of(spec: Any, out: Path) -> Any:
    """The same where envs that have ended are stepped with the others."""
    return episodes_of(spec, out, heed=False)


def engine_of(spec: Any, _out: Path) -> Any:
    """The engine that was made: how many envs and workers, how long it waits for them, and its options."""
    with anysim.make(spec) as env:
        engine: Any = env.engine
        workers = len(getattr(engine, "workers", ())), getattr(engine, "timeout_s", None)
        return engine.name, engine.num_envs, workers, repr(getattr(engine, "options", None))


def expert_of(spec: Any, out: Path) -> Any:
    """The solution of the task, and what it says it does in a few control steps."""
    del out
    with anysim.make(spec) as env:
        policy, said = SkillPolicy(env), []
        env.reset(seed=0)
        policy.begin(np.array([0]))
        for _ in range(60):
            if not env.running[0]:
                break
            env.step(policy.act(np.array([0])))
            said.append(policy.describe(0))
        return policy.name, said


def shipped_of(spec: Any, out: Path) -> Any:
    """What is said of a shipped policy that is not there."""
    del out
    with anysim.make(spec) as env, pytest.raises(AnysimError) as told:
        registry.load("env_policies", "shipped")(env)
    return str(told.value)


class Still:
    """A policy: zeros."""

    name = "still"

    def __init__(self, env: TaskEnv) -> None:
        self._env = env

    def begin(self, env_ids: Any) -> None:
        pass

    def act(self, env_ids: Any) -> Any:
        return np.zeros((self._env.num_envs, self._env.action_dim))

    def gave_up(self, env_ids: Any) -> Any:
        return np.zeros(len(env_ids), bool)

    def solved(self, env_ids: Any) -> Any:
        return np.zeros(len(env_ids), dtype=bool)

    def ended(self, env: int, success: bool) -> dict[str, Any]:
        del env, success
        return {}

    def describe(self, env: int) -> dict[str, Any]:
        return {}


def recorded_of(spec: Any, out: Path) -> Any:
    """Two episodes: what their manifests say but for the spec, their videos, and how images were asked for."""
    seen: list[Any] = []
    asked: Counter[str] = Counter()
    with anysim.make(spec, num_envs=2) as env:
        for name in ("image", "image_then"):
            setattr(env.capture, name, counted(getattr(env.capture, name), name, asked))
        seen += [(result.status, result.steps) for result in Collector(env, Still(env), out, 2, seed=0).run()]
    for folder in trajectories(out):
        told = read_manifest(folder).to_dict()
        files = {name: entry if name.endswith(".mp4") else None for name, entry in told.pop("files").items()}
        told = {key: value for key, value in told.items() if key not in ("spec", "clock", "packages")}
        seen += [json.dumps(told, sort_keys=True), files]
    return seen, asked


def counted(call: Callable[..., Any], name: str, asked: Counter[str]) -> Callable[..., Any]:
    """The call, counted."""

    def calling(*args: Any) -> Any:
        asked[name] += 1
        return call(*args)

    return calling


def filmed_of(spec: Any, out: Path) -> Any:
    """The same on an engine that draws, and the images that are observed."""
    require_drawing("mujoco")
    seen = recorded_of(spec, out)
    with anysim.make(spec) as env:
        obs = [env.reset(seed=0)[0], *(env.step(np.full((1, env.action_dim), 1.0)).obs for _ in range(3))]
        return seen, [[repr(value) for key, value in sorted(o.items()) if key.startswith("images")] for o in obs]


SEEN: dict[str, Callable[[Any, Path], Any]] = {
    "world": world_of,
    "episode": episodes_of,
    "stepped": stepped_of,
    "engine": engine_of,
    "expert": expert_of,
    "shipped": shipped_of,
    "recorded": recorded_of,
    "filmed": filmed_of,
}


BEFORE: dict[tuple[str, tuple[str, ...]], Any] = {}


def seen_before(name: str, given: tuple[str, ...], files: Path, out: Path) -> Any:
    """What is seen of the file without the change, once for all rows that begin with it."""
    if (name, given) not in BEFORE:
        BEFORE[name, given] = SEEN[name](loaded(Row(given, (), None, ""), files, changed=False), out / "before")
    return BEFORE[name, given]


@pytest.mark.parametrize("name", SEEN)
def test_the_same_file_looks_the_same(name: str, files: Path, tmp_path: Path) -> None:
    needed = {"filmed": "RecordSpec.fps", "expert": "TaskSpec.expert"}
    row = Row(ROWS[needed[name]].given if name in needed else (), (), None, "")
    first, again = (SEEN[name](loaded(row, files, changed=False), tmp_path / turn) for turn in ("first", "again"))
    assert first == again


@pytest.mark.parametrize("key", ROWS)
def test_a_change_has_an_effect(key: str, files: Path, tmp_path: Path) -> None:
    row = ROWS[key]
    after = tmp_path / "after"
    if row.error:
        name = row.seen or "episode"
        seen_before(name, row.given, files, tmp_path)
        with pytest.raises(AnysimError, match=row.error):
            SEEN[name](loaded(row, files, changed=True), after)
        return
    spec = loaded(row, files, changed=True)
    for name in (row.seen,) if row.seen else ("world", "episode"):
        if seen_before(name, row.given, files, tmp_path) != SEEN[name](spec, after):
            return
    pytest.fail(f"{key}: nothing changes")
