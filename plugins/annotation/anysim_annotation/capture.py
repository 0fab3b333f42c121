"""Capture: cameras of an engine with annotators, which label one moment of a batch of envs at a time."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from anysim import registry
from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import AnysimError, listing
from anysim.task.env import TaskEnv
from anysim_annotation.api import Annotator, Labels, Record, SegmentAnnotator
from anysim_annotation.declared import check_labels
from anysim_annotation.orders import Orders, make_annotator
from anysim_annotation.segments import Intentions, SegmentLog
from anysim_annotation.view import NOTHING, Scene, Source, View
from anysim_sensors.scene import SceneGeometry


class Moment(NamedTuple):
    """Envs (E,) at a step: now, or as they were recorded; arrays as in `State`.

    Attributes:
        env_ids, steps: (E,).
        body_pose: (E, B, 7).
        joint_pos: (E, J), None where it is not known.
        commands: (E, A) targets of the drives by actuator, None where they are not known.
        said: what the skill of each env says that it does; empty where there is none.
    """

    env_ids: Array
    steps: Array
    body_pose: Array
    joint_pos: Array | None = None
    commands: Array | None = None
    said: tuple[Mapping[str, Any], ...] = ()


class SegmentLabels(NamedTuple):
    """Records of a segment that has ended."""

    camera: str
    annotator: str
    env: int
    records: Sequence[Record]


class _Eye:
    """One camera with its annotators."""

    def __init__(self, scene: Scene, orders: Orders, intentions: Intentions | None) -> None:
        made = {name: make_annotator(name, params, scene) for name, params in orders.items()}
        self.scene = scene
        self.annotators = {name: one for name, one in made.items() if isinstance(one, Annotator)}
        segments = {name: one for name, one in made.items() if isinstance(one, SegmentAnnotator)}
        self.log = SegmentLog(segments, intentions) if segments else None
        self.wanted = frozenset(channel for one in self.annotators.values() for channel in one.needs)
        self.before: View | None = None
        self.gone: set[int] = set()
        """Envs whose episodes have begun after `before` was seen."""


class Capture:
    """Labels what cameras see. Made once for an engine or an env, and asked at each step that is to be labelled.

    Nothing is drawn or computed that no annotator needs, and what several need is computed once. A rebuilt engine needs
    a new one.
    """

    def __init__(
        self, env: TaskEnv | SimEngine, cameras: Mapping[str, Orders | Sequence[str]], source: Source = "engine"
    ) -> None:
        """`cameras`: for each the annotators by name, with their parameters or without.

        Raises:
            PluginError, SpecError: an annotator is not installed, or a parameter is wrong.
        """
        self.engine: SimEngine = env.engine if isinstance(env, TaskEnv) else env
        self.env = env if isinstance(env, TaskEnv) else None
        geometry = SceneGeometry(self.engine.world, "visual")
        intentions = None if self.env is None else Intentions(self.env)
        self._eyes: dict[str, _Eye] = {}
        for name, wanted in cameras.items():
            orders: Orders = wanted if isinstance(wanted, Mapping) else {one: NOTHING for one in wanted}
            self._eyes[name] = _Eye(Scene(self.engine, name, source, self.env, geometry), orders, intentions)

    def scene(self, camera: str) -> Scene:
        """What is before a camera."""
        return self._eyes[camera].scene

    def annotators(self, camera: str) -> Mapping[str, Annotator | SegmentAnnotator]:
        """The annotators of a camera, by name."""
        eye = self._eyes[camera]
        return eye.annotators if eye.log is None else eye.annotators | dict(eye.log.annotators)

    def begin(self, env_ids: Sequence[int] | Array | None = None) -> None:
        """Episodes begin in these envs, in all if not given: what was seen there before is forgotten."""
        self.follow_from(env_ids)
        self.forget(env_ids)

    def follow_from(self, env_ids: Sequence[int] | Array | None = None) -> None:
        """The half of `begin` that concerns `look` and `follow`."""
        ids = np.arange(self.engine.num_envs) if env_ids is None else np.asarray(env_ids, dtype=np.int64)
        for eye in self._eyes.values():
            if eye.log is not None:
                eye.log.forget(ids.tolist())
            if eye.before is not None:
                eye.gone |= set(ids.tolist())

    def forget(self, env_ids: Sequence[int] | Array | None = None) -> None:
        """The half of `begin` that concerns `label`."""
        ids = np.arange(self.engine.num_envs) if env_ids is None else np.asarray(env_ids, dtype=np.int64)
        for eye in self._eyes.values():
            for annotator in eye.annotators.values():
                annotator.reset(ids)

    def now(self, env_ids: Sequence[int] | Array | None = None, said: Sequence[Mapping[str, Any]] = ()) -> Moment:
        """The envs as they are; `said` is what `SkillPolicy.describe` says of each."""
        ids = np.arange(self.engine.num_envs) if env_ids is None else np.asarray(env_ids, dtype=np.int64)
        state = self.engine.get_state()
        steps = np.zeros(len(ids), dtype=np.int64) if self.env is None else self.env.scene.elapsed[ids].copy()
        commands = self.engine.control.position[ids].copy()
        return Moment(ids, steps, state.body_pose[ids], state.joint_pos[ids], commands, tuple(said))

    def take(self, moment: Moment | None = None) -> dict[str, dict[str, Labels]]:
        """Labels of a moment, of now if not given, by camera and annotator; row by row its envs."""
        return self.label(self.look(self.now() if moment is None else moment))

    def look(self, moment: Moment) -> dict[str, View]:
        """What the cameras see of a moment, by camera: all that needs the engine is drawn."""
        found: dict[str, View] = {}
        for camera, eye in self._eyes.items():
            view = found[camera] = self._view(eye, moment, eye.wanted)
            view.draw()
            eye.before, eye.gone = (view if eye.wanted & {"flow", "occluded"} else None), set()
        return found

    def label(self, seen: Mapping[str, View]) -> dict[str, dict[str, Labels]]:
        """Labels of what was looked at, by camera and annotator: in the order in which it was, in any one thread."""
        found: dict[str, dict[str, Labels]] = {}
        for camera, view in seen.items():
            found[camera] = {}
            for name, annotator in self._eyes[camera].annotators.items():
                view.granted = annotator.needs
                with registry.using("annotators", name):
                    labels = annotator.annotate(view)
                check_labels(name, annotator, labels, view)
                found[camera][name] = labels
            view.before, view.granted = None, ()
        return found

    def follow(self, moment: Moment) -> list[SegmentLabels]:
        """Look at a step for the annotators of segments: labels of those that ended before it. No image is needed."""
        found: list[SegmentLabels] = []
        for camera, eye in self._eyes.items():
            if eye.log is not None:
                ended = eye.log.follow(self._view(eye, moment, frozenset()))
                found += [SegmentLabels(camera, name, env, records) for env, name, records in ended]
        return found

    def finish(self, env_ids: Sequence[int] | Array | None = None) -> list[SegmentLabels]:
        """Labels of the segments under way in envs whose episodes have ended, in all if not given."""
        ids = range(self.engine.num_envs) if env_ids is None else np.asarray(env_ids).tolist()
        return [
            SegmentLabels(camera, name, env, records)
            for camera, eye in self._eyes.items()
            if eye.log is not None
            for env, name, records in eye.log.finish(ids)
        ]

    def _view(self, eye: _Eye, moment: Moment, wanted: frozenset[str]) -> View:
        if moment.said and len(moment.said) != len(moment.env_ids):
            raise AnysimError(f"{len(moment.said)} descriptions for {len(moment.env_ids)} envs; give one of each")
        ids, camera = moment.env_ids, eye.scene.camera
        drawn = self.engine.camera_view(camera, ids, moment.body_pose)
        before = None
        if eye.before is not None:
            place = {env: row for row, env in enumerate(eye.before.env_ids.tolist()) if env not in eye.gone}
            before = eye.before, np.array([place.get(env, -1) for env in ids.tolist()])
        return View(
            eye.scene,
            ids,
            np.asarray(moment.steps),
            drawn.pose,
            drawn.fov,
            drawn.body_pose,
            self.engine.presence[ids],
            moment.joint_pos,
            moment.commands,
            moment.said,
            wanted,
            before=before,
        )


def refuse_unknown_cameras(engine: SimEngine, cameras: Sequence[str]) -> None:
    """Raise AnysimError for a camera that the world does not have."""
    names = [camera.name for camera in engine.world.cameras]
    for name in cameras:
        if name not in names:
            raise AnysimError(f"there is no camera '{name}' (cameras: {listing(names)})")
