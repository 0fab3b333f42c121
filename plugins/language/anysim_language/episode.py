"""Episodes to speak of: one that a task would begin, or a recorded one, with what was drawn and where things are."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from anysim.api import blind_env, compile_world, load, place_of, watched
from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.model.world import World
from anysim.randomization.streams import episode_seed
from anysim.record.columns import EpisodeColumns
from anysim.record.header import EpisodeHeader
from anysim.record.manifest import Manifest
from anysim.record.reader import TrajectoryReader, open_trajectory
from anysim.record.replay import begin
from anysim.task.bindings import Bindings
from anysim.task.env import TaskEnv
from anysim_language.moment import Moment, Viewer, viewer_of
from anysim_language.things import Thing, things_of
from anysim_language.vocabulary import Vocabulary, vocabulary
from anysim_schemas.collect import written_out
from anysim_schemas.load import LoadedRun


@dataclass(frozen=True)
class Deed:
    """A skill that the task names, with the parameters of this episode."""

    skill: str
    params: Mapping[str, Any]


@dataclass(frozen=True)
class View:
    """A camera: its optical frame (7,) in that of a body, or in the world's where `body` is -1; `fov` is in degrees."""

    name: str
    body: int
    pose: Array
    fov: float
    width: int
    height: int


@dataclass(frozen=True)
class Episode:
    """One episode as language sees it.

    Attributes:
        name: of the task.
        seed: the episode seed.
        world: neutral.
        things: what is there.
        viewer: who sees left and right.
        instruction: the task's own words.
        deeds: the task's commands, or its expert, in order.
        goals: poses (7,) by the names of the task's goals.
        goal_frames: the frame that a goal is beside or in, by the goal's name, where it is at one.
        body_pose: (K, B, 7) at steps 0 to K - 1.
        joint_pos: (K, J).
        annotations: K - 1 of them: what the policy said at each control step.
        views: the world's cameras as they are mounted in this episode.
        lights: how many lights the world declares.
        status: how it ended; empty for one that has only begun.
        vocabulary: the words.
        reader: of the recording; None where there is none.
        base: the folder of the recorded file, where its world has assets with relative paths.
    """

    name: str
    seed: int
    world: World
    things: tuple[Thing, ...]
    viewer: Viewer
    instruction: str
    deeds: tuple[Deed, ...]
    goals: Mapping[str, Array]
    goal_frames: Mapping[str, str]
    body_pose: Array
    joint_pos: Array
    annotations: tuple[Mapping[str, Any], ...]
    views: tuple["View", ...]
    lights: int
    status: str
    vocabulary: Vocabulary
    reader: TrajectoryReader | None = None
    base: Path | None = None

    def moment(self, step: int) -> Moment:
        """The things at a control step; 0 is right after the reset, and -1 the last one."""
        step %= len(self.body_pose)
        return Moment(self.world, self.things, self.viewer, self.body_pose[step], step)

    @cached_property
    def first(self) -> Moment:
        """The things right after the reset."""
        return self.moment(0)


def begun(source: str | Path | LoadedRun, seed: int | None = None, overrides: Sequence[str] = ()) -> Episode:
    """The first episode of a task or world under a global seed, as it begins; no engine is needed."""
    (episode,) = begun_many(source, [seed], overrides)
    return episode


def begun_many(
    source: str | Path | LoadedRun, seeds: Sequence[int | None], overrides: Sequence[str] = ()
) -> Iterator[Episode]:
    """The first episodes under several global seeds, one after the other; the world is compiled once."""
    loaded = watched(load(source, overrides=overrides) if isinstance(source, str | Path) else source)
    name = loaded.spec.world.name
    with blind_env(loaded, compile_world(loaded), name) as env:
        for seed in seeds:
            chosen = episode_seed(loaded.spec.seed if seed is None else seed, 0, 0)
            env.reset(episode_seeds=[chosen])
            state = env.engine.get_state()
            yield _episode(env, loaded, name, chosen, np.array(state.body_pose), np.array(state.joint_pos))


def recorded(trajectory: Path, base: Path | None = None) -> Episode:
    """A recorded episode: its world is compiled anew, and its draws are made again from its seed.

    Args:
        trajectory: the directory of a committed one.
        base: the folder of the recorded file, where its world has assets with relative paths.

    Raises:
        RecordError: it does not hold poses, or its world cannot be made as it was.
    """
    reader = open_trajectory(trajectory)
    manifest = reader.manifest
    for field in ("body_pose", "joint_pos"):
        if field not in manifest.layout.state or not reader.initial_state:
            raise RecordError(f"{trajectory} does not hold {field} from its reset on, which its description is made of")
    loaded = load(dict(manifest.spec) | {"num_envs": 1})
    with blind_env(loaded, compile_world(loaded, base=base), manifest.task) as env:
        begin(env, manifest)
        poses = _rows(manifest, reader, "body_pose", [b.name for b in env.engine.world.bodies], manifest.layout.bodies)
        joints = _rows(manifest, reader, "joint_pos", [j.name for j in env.engine.world.joints], manifest.layout.joints)
        return _episode(env, loaded, manifest.task, manifest.episode_seed, poses, joints, reader, base)


def ended(env: TaskEnv, loaded: LoadedRun, columns: EpisodeColumns, status: str) -> Episode:
    """An episode that has just ended, by its columns with their reset, in a blind env of its world."""
    said = dict(columns.annotations)
    held = list(accumulate(range(len(columns)), lambda last, row: said.get(row, last), initial={}))
    poses, joints = columns.state["body_pose"], columns.state["joint_pos"]
    return going(env, loaded, columns.header.episode, poses, joints, held[2:], status)


def going(
    env: TaskEnv, loaded: LoadedRun, header: EpisodeHeader, poses: Array, joints: Array, said: Sequence[Any], word: str
) -> Episode:
    """An episode so far, in a blind env: states from the reset on, what was `said` in each step, and its status."""
    begin(env, header)
    found = _episode(env, loaded, env.name, header.episode_seed, poses, joints)
    return replace(found, instruction=header.instruction, annotations=tuple(said), status=word)


def _rows(manifest: Manifest, reader: TrajectoryReader, field: str, here: Sequence[str], there: Sequence[str]) -> Array:
    """A state array with the reset's row first, by the names of the world at hand."""
    lost = sorted(set(here) - set(there))
    if lost:
        raise RecordError(f"{reader.directory} does not hold '{lost[0]}', which the world of {manifest.task} has now")
    columns = [list(there).index(name) for name in here]
    return reader.states_from_reset(field)[:, columns]


def _episode(
    env: TaskEnv,
    loaded: LoadedRun,
    name: str,
    seed: int,
    poses: Array,
    joints: Array,
    reader: TrajectoryReader | None = None,
    base: Path | None = None,
) -> Episode:
    world, words = env.engine.world, vocabulary()
    folder = partial(_folder, loaded, base)
    things, deeds = things_of(env.engine, words.words, folder=folder), tuple(_deeds(env, loaded))
    return Episode(
        name=name,
        seed=seed,
        world=world,
        things=things,
        viewer=viewer_of(world, things, poses[0]),
        instruction=reader.manifest.instruction if reader is not None else env.instruction(0),
        deeds=deeds,
        goals={name: goal[0].copy() for name, goal in env.scene.poses.items()},
        goal_frames=_goal_frames(loaded, deeds, {thing.name for thing in things if thing.robot}),
        body_pose=poses,
        joint_pos=joints,
        annotations=() if reader is None else reader.annotations,
        views=tuple(_view(env, camera.name) for camera in world.cameras),
        lights=len(world.lights),
        status="" if reader is None else reader.manifest.status,
        vocabulary=words,
        reader=reader,
        base=base,
    )


def _folder(loaded: LoadedRun, base: Path | None, category: str) -> Path | None:
    """The folder of the file that says where the asset of an object is; `base` where that is not known."""
    place = place_of(loaded, f"world.objects.{category}.source").rsplit(":", 2)[0]
    return base or (Path(place).parent if Path(place).is_file() else None)


def _view(env: TaskEnv, name: str) -> View:
    engine = env.engine
    camera = engine.world.cameras[engine.index.camera(name)]
    pose, fov = engine.camera_mounts(name, [0])[0], float(engine.camera_fov(name, [0])[0])
    return View(name, camera.body, np.array(pose, dtype=float), fov, camera.width, camera.height)


def _goal_frames(loaded: LoadedRun, deeds: Sequence[Deed], robots: Collection[str]) -> dict[str, str]:
    """What the goals of a task are at: things that they are beside, and insides that they are in.

    A goal that is stated from where a robot, or what is brought to it, begins is at none of them.
    """
    brought = {(deed.params.get("goal"), deed.params.get("object")) for deed in deeds}
    command = loaded.spec.task.command if loaded.spec.task is not None else {}
    found: dict[str, str] = {}
    for name, term in command.items():
        frame = term.params.get("frame")
        if isinstance(frame, str) and (term.term == "goal_beside" or frame.endswith(".inside")):
            owner = frame.partition(".")[0]
            if owner not in robots and (name, owner) not in brought:
                found[name] = frame
    return found


def _deeds(env: TaskEnv, loaded: LoadedRun) -> Iterator[Deed]:
    """The commands that this episode has, written out; a repeated one once."""
    task, collect = loaded.spec.task, loaded.spec.collect
    if collect is not None:
        index = env.bindings.index
        drawn = written_out(
            collect.commands, "collect.commands", drawn=lambda path: int(index[path][0]), repeated=False
        )
        for spec, path in drawn:
            yield Deed(spec.do, _bound(env.bindings, spec.params, path))
    elif task is not None and task.expert is not None:
        yield Deed(task.expert.skill, _bound(env.bindings, task.expert.params, "task.expert.params"))


def _bound(bindings: Bindings, params: Mapping[str, Any], path: str) -> Mapping[str, Any]:
    """Parameters with what was drawn for this episode in place of `$name`."""
    names, variants = bindings.variants(params, path)
    return variants[int(bindings.which(names, np.array([0]))[0])]
