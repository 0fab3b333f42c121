"""View of a camera at a moment in a batch of envs: poses, names, and channels that are computed once."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from anysim.conventions import Array
from anysim.engine.base import SimEngine
from anysim.errors import AnysimError, listing
from anysim.task.env import TaskEnv
from anysim_annotation import channels, lens
from anysim_annotation.legend import Legend
from anysim_sensors.camera import Images, RayCamera
from anysim_sensors.scene import SceneGeometry

Source = Literal["engine", "geometry"]
"""Where depth and segmentation come from: the engine's drawing, or rays on the World's geometry."""
NOTHING: Mapping[str, Any] = {}
FROM_DEPTH = frozenset({"depth", "points", "normals", "flow", "occluded"})
FROM_IDS = frozenset({"segmentation", "normals", "flow", "occluded"})
"""Channels that are made of the depth that an engine draws, and of its segmentation."""


class Scene:
    """The world before a camera: what does not change while an engine lives.

    Attributes:
        engine: draws, where the source is `engine`.
        env: the task around it; None where there is none, and nothing is known of skills.
        camera: its name.
        width, height: of its images [px].
        source: of depth and segmentation.
        geometry: the visible shapes.
        legend: names and numbers of things.
    """

    def __init__(
        self,
        engine: SimEngine,
        camera: str,
        source: Source = "engine",
        env: TaskEnv | None = None,
        geometry: SceneGeometry | None = None,
    ) -> None:
        self.engine, self.env, self.camera, self.source = engine, env, camera, source
        self.world = engine.world
        view = engine.camera_view(camera, [0])
        self.width, self.height, self.near, self.far = view.width, view.height, view.near, view.far
        self.geometry = SceneGeometry(self.world, "visual") if geometry is None else geometry
        self.legend = Legend(self.world)
        self._lens: tuple[bytes, RayCamera] | None = None

    def rays(self, fov: Array) -> RayCamera:
        """The rays of the camera with fields of view (E,) [degrees]."""
        key = fov.tobytes()
        if self._lens is None or self._lens[0] != key:
            alike = fov[:1] if (fov == fov[0]).all() else fov
            self._lens = key, RayCamera(self.width, self.height, alike, self.near, self.far)
        return self._lens[1]


@dataclass(eq=False)
class View:
    """A camera at one moment in E envs. Ask it for a channel by name: `view["depth"]`, see `anysim_annotation.api`.

    Attributes:
        scene: see above.
        env_ids: (E,).
        steps: (E,) control steps since the reset.
        pose: (E, 7) world poses of the optical frame.
        fov: (E,) vertical [degrees].
        body_pose: (E, B, 7).
        present: (E, entities) bool.
        joint_pos: (E, J), where it is known.
        commands: (E, A) what drives are told to reach, by actuator, where it is known.
        said: what the env's skill says that it does: `{"skill": …, "phase": …}`.
        wanted: the channels that will be asked for; they are drawn together.
        granted: those that may be asked for now.
        before: an earlier view of the same camera with the row of each env in it, -1 where it has none.
    """

    scene: Scene
    env_ids: Array
    steps: Array
    pose: Array
    fov: Array
    body_pose: Array
    present: Array
    joint_pos: Array | None = None
    commands: Array | None = None
    said: tuple[Mapping[str, Any], ...] = ()
    wanted: frozenset[str] = frozenset()
    granted: Collection[str] = ()
    before: "tuple[View, Array] | None" = None
    _memo: dict[str, Any] = field(default_factory=dict, repr=False)

    def __len__(self) -> int:
        return len(self.env_ids)

    def __getitem__(self, channel: str) -> Array:
        """A channel, read-only.

        Raises:
            AnysimError: it is not among those that the annotator has declared.
        """
        if channel not in self.granted:
            raise AnysimError(
                f"the channel '{channel}' was not declared; name it in `needs` (declared: {listing(self.granted)})"
            )
        return self.channel(channel)

    def channel(self, name: str) -> Array:
        """A channel, computed when it is first asked for."""
        match name:
            case "depth" | "segmentation" | "rgb":
                return self._drawn[name]
            case "whole":
                return self._once(name, lambda: self.traced.whole)
            case "normals":
                return self._once(name, lambda: channels.normals(self))
            case "points":
                return self._once(name, lambda: channels.points(self))
            case "flow" | "occluded":
                return self._once("moved", lambda: channels.moved(self))[0 if name == "flow" else 1]
            case _:
                raise AnysimError(f"there is no channel '{name}'; see anysim_annotation.api.Channel")

    def draw(self) -> None:
        """See now what is wanted of the engine, which cannot do so later; rays can."""
        if self.scene.source == "geometry" and "rgb" not in self.wanted:
            return
        if self.wanted & (FROM_DEPTH | FROM_IDS | {"rgb"}):
            _ = self._drawn

    @property
    def traced(self) -> Images:
        """The images by rays, whatever the source is."""
        return self._once("traced", lambda: self._trace())

    @property
    def local(self) -> Array:
        """(E, H, W, 3) [m] what is seen at each pixel, optical frame, from `depth`; not finite where nothing is."""

        def made() -> Array:
            scene = self.scene
            along = scene.rays(self.fov).directions
            rays = (along / along[..., 2:]).reshape(len(along), scene.height, scene.width, 3)
            with np.errstate(invalid="ignore"):
                return rays * self.channel("depth")[..., None].astype(float)

        return self._once("local", made)

    @property
    def bodies(self) -> Array:
        """(E, H, W) int32, the body that is seen at each pixel, -1 for the world and for nothing."""
        return self._once("bodies", lambda: channels.bodies(self))

    def project(self, points: Array) -> lens.Projected:
        """Points (E, ..., 3) [m] of the world in the image, whatever stands before them."""
        return lens.project(points, self.pose, self.fov, self.scene.width, self.scene.height)

    def row(self, number: int) -> "View":
        """One env of it, with poses and words and no images."""
        at = slice(number, number + 1)
        return View(
            self.scene,
            self.env_ids[at],
            self.steps[at],
            self.pose[at],
            self.fov[at],
            self.body_pose[at],
            self.present[at],
            None if self.joint_pos is None else self.joint_pos[at],
            None if self.commands is None else self.commands[at],
            self.said[at],
        )

    # ------------------------------------------------------------------ what is drawn

    @property
    def _drawn(self) -> Mapping[str, Array]:
        return self._once("drawn", self._draw)

    def _draw(self) -> dict[str, Array]:
        scene, found = self.scene, dict[str, Array]()
        if scene.source == "geometry":
            traced = self.traced
            found = {"depth": traced.depth, "segmentation": traced.segmentation}
        asked = ["rgb"] if "rgb" in self.wanted else []
        if scene.source == "engine":
            parts = {"depth": FROM_DEPTH, "segmentation": FROM_IDS}
            asked += [name for name, channels in parts.items() if self.wanted & channels]
        if asked:
            found |= scene.engine.render(scene.camera, env_ids=self.env_ids, channels=asked, body_pose=self.body_pose)
        return found

    def _trace(self) -> Images:
        scene = self.scene
        posed = scene.geometry.posed(self.body_pose, self.present)
        exact = scene.source == "geometry" and "normals" in self.wanted
        whole = "whole" in self.wanted
        return scene.rays(self.fov).images(scene.geometry, posed, self.pose, normals=exact, whole=whole)

    def _once(self, name: str, make: Callable[[], Any]) -> Any:
        if name not in self._memo:
            made = make()
            for rows in (made,) if isinstance(made, np.ndarray) else made.values() if isinstance(made, dict) else made:
                rows.setflags(write=False)
            self._memo[name] = made
        return self._memo[name]


class Segment(NamedTuple):
    """A stretch of an episode in which a skill did one thing.

    Attributes:
        skill, phase: in its own words; the phase is that of the last step.
        command: the number of the command, from 1; 0 where the episode has none.
        attempt: of the skill.
        params: the parameters of the command in the file, with what was drawn for them.
        first, last: one env at the segment's first and last step.
    """

    skill: str
    phase: str
    command: int
    attempt: int
    params: Mapping[str, Any]
    first: View
    last: View
