"""The scene in the page: one node a body, batches of what looks alike, and what moves in each moment."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.math import pose as P
from anysim.model.world import World
from anysim_viewer.moment import Matter, Moment
from anysim_viewer.page import Page
from anysim_viewer.solids import Looks, Solid, Solids, alike, built_looks, tinted

BATCH = 6
"""Bodies that look the same are drawn as one batch from this many on."""
NEWTONS_A_METRE = 100.0
"""[N/m] of the arrows of forces, at a scale of 1."""
LONGEST = 0.5
"""[m] of the arrow of a force: one that is larger is drawn no longer."""
FORCE, GOAL_COLORS = (235, 60, 40), ((255, 0, 170), (0, 200, 255), (255, 190, 0), (120, 255, 60))
_EYE = 2.2


class Drawing:
    """A World in a page. `show` moves what has moved and sends nothing else.

    Attributes:
        shown: what the page's switches say: `tools`, `goals`, `contacts`, `matter`, `names`.
        force_scale: arrows of forces are longer by this.
    """

    def __init__(self, page: Page, world: World) -> None:
        self.page, self.world, self._scene = page, world, page.server.scene
        self.shown = {"tools": True, "goals": True, "contacts": False, "matter": True}
        self.force_scale = 1.0
        self._solids = Solids(world)
        self._nodes: dict[int, Any] = {}
        self._batches: list[tuple[tuple[int, ...], Array, Any]] = []
        self._extras: dict[str, Any] = {}
        self._pose = np.full((len(world.bodies), 7), np.nan)
        self._there: Array | None = None
        self._looks: Looks | None = None
        self._entity = np.array(world.body_entity, dtype=int)
        tools = [(f"{r.name}.{name}", world.sites[site]) for r in world.robots for name, site in r.tools.items()]
        self._tools = [(name, site.body, P.pose(site.position, site.quaternion)) for name, site in tools]
        self._aim()

    def look(self, looks: Looks) -> None:
        """Have bodies look like this; nothing is sent where they do."""
        before = self._looks
        if before is not None and all(np.array_equal(a, b) for a, b in zip(before, looks, strict=True)):
            return
        self._looks = looks
        with self.page.server.atomic():
            for name in ("/ground", "/bodies", "/batches"):
                self._scene.remove_by_name(name)
            self._nodes, self._batches = {}, []
            self._build(looks)
        self._pose[:], self._there = np.nan, None

    def show(self, moment: Moment) -> None:
        """Show a moment."""
        if self._looks is None:
            self.look(built_looks(self.world))
        with self.page.server.atomic():
            self._move(moment.body_pose, moment.present)
            self._frames(moment)
            self._forces(moment)
            self._flow(moment.matter if self.shown["matter"] else {})

    # ------------------------------------------------------------------ bodies

    def _build(self, looks: Looks) -> None:
        fixed = [number for number, geom in enumerate(self.world.geoms) if geom.body < 0]
        for number, solid in enumerate(self._solids.of(fixed, looks)):
            self._mesh(f"/ground/{number}", solid)
        batches = alike(self.world, looks, BATCH)
        in_batch = {body for bodies in batches.values() for body in bodies}
        for first, bodies in batches.items():
            for geom in self.world.body_geoms[first]:
                if self.world.geoms[geom].visible:
                    self._batch(bodies, geom, looks)
        for body, geoms in enumerate(self.world.body_geoms):
            solids = [] if body in in_batch else self._solids.of(geoms, looks)
            if solids:
                name = f"/bodies/{body}-{self.world.bodies[body].name.replace('/', '-')}"
                self._nodes[body] = self._scene.add_frame(name, show_axes=False)
                for number, solid in enumerate(solids):
                    self._mesh(f"{name}/{number}", solid)

    def _mesh(self, name: str, solid: Solid) -> None:
        look = solid.look
        if look.texture >= 0:
            self._textured(name, solid)
            return
        self._scene.add_mesh_simple(
            name,
            solid.vertices,
            solid.faces,
            color=look.color,
            opacity=None if look.opacity >= 1.0 else look.opacity,
            flat_shading=not look.smooth,
            side="double" if len(solid.faces) <= 2 else "front",
        )

    def _textured(self, name: str, solid: Solid) -> None:
        from PIL import Image
        from trimesh import Trimesh
        from trimesh.visual import TextureVisuals
        from trimesh.visual.material import PBRMaterial

        texture = self.world.textures[solid.look.texture]
        once = len(solid.places) == 0 or float(solid.places.max()) <= 1.0
        image = Image.fromarray(tinted(texture, solid.look.color, whole=once))
        material = PBRMaterial(baseColorTexture=image, metallicFactor=0.0, roughnessFactor=0.9, doubleSided=True)
        visual = TextureVisuals(uv=solid.places, material=material)
        mesh = Trimesh(solid.vertices, solid.faces, visual=visual, process=False)
        self._scene.add_mesh_trimesh(name, mesh)

    def _batch(self, bodies: tuple[int, ...], geom: int, looks: Looks) -> None:
        (solid,) = self._solids.of([geom], looks)
        count = len(bodies)
        handle = self._scene.add_batched_meshes_simple(
            f"/batches/{bodies[0]}-{geom}",
            solid.vertices,
            solid.faces,
            batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            batched_positions=np.zeros((count, 3)),
            batched_scales=np.zeros(count),
            batched_colors=np.array(solid.look.color, dtype=np.uint8),
            opacity=None if solid.look.opacity >= 1.0 else solid.look.opacity,
            flat_shading=not solid.look.smooth,
            lod="off",
        )
        self._batches.append((bodies, np.array(bodies), handle))

    def _move(self, pose: Array, present: Array) -> None:
        there = np.ones(len(pose), dtype=bool) if len(present) == 0 else present[self._entity]
        same: Array = np.isclose(pose, self._pose, rtol=0.0, atol=1e-6)
        moved = np.asarray(~same.all(axis=1))
        changed: Array = np.ones(len(pose), dtype=bool)
        if self._there is not None:
            changed = np.asarray(there ^ self._there)
        for body, node in self._nodes.items():
            if changed[body]:
                node.visible = bool(there[body])
            if (moved[body] or changed[body]) and there[body]:
                node.position, node.wxyz = pose[body, :3], pose[body, [6, 3, 4, 5]]
        for bodies, rows, handle in self._batches:
            if moved[rows].any() or changed[rows].any():
                handle.batched_positions = pose[rows, :3].astype(np.float32)
                handle.batched_wxyzs = pose[rows][:, [6, 3, 4, 5]].astype(np.float32)
            if changed[rows].any():
                handle.batched_scales = there[list(bodies)].astype(np.float32)
        self._pose, self._there = np.array(pose, dtype=float), there

    # ------------------------------------------------------------------ frames, forces, matter

    def _frames(self, moment: Moment) -> None:
        for name, body, local in self._tools:
            pose = local if body < 0 else P.compose(moment.body_pose[body], local)
            there = body < 0 or bool(moment.present[self._entity[body]])
            self._frame(f"/tools/{name}", pose, self.shown["tools"] and there, None)
        for number, (name, pose) in enumerate(moment.goals.items()):
            self._frame(f"/goals/{name}", pose, self.shown["goals"], GOAL_COLORS[number % len(GOAL_COLORS)])

    def _frame(self, name: str, pose: Array, visible: bool, color: tuple[int, int, int] | None) -> None:
        node = self._extras.get(name)
        if node is None:
            if not visible:
                return
            node = self._extras[name] = self._scene.add_frame(name, axes_length=0.08, axes_radius=0.002, visible=True)
            if color is not None:
                self._scene.add_icosphere(f"{name}/ball", radius=0.025, color=color, opacity=0.45)
            self._scene.add_label(f"{name}/name", name.rpartition("/")[2])
        if node.visible != visible:
            node.visible = visible
        if visible:
            place(node, pose)

    def _forces(self, moment: Moment) -> None:
        found = moment.contacts
        count = 0 if found is None or not self.shown["contacts"] else len(found.position)
        points, arrows = np.zeros((count, 3), np.float32), np.zeros((count, 2, 3), np.float32)
        if found is not None and count:
            along = found.force * (self.force_scale / NEWTONS_A_METRE)
            size = np.linalg.norm(along, axis=1, keepdims=True)
            along = along * np.minimum(1.0, LONGEST / np.maximum(size, 1e-9))
            points[:] = found.position
            arrows[:, 0], arrows[:, 1] = found.position, found.position + along
            arrows = arrows[size[:, 0] > 1e-3]
        self._cloud("/contacts/points", points, 0.006, np.array(FORCE))
        old = self._extras.pop("/contacts/forces", None)
        if len(arrows) == 0:
            if old is not None:
                old.remove()
            return
        if old is None or len(old.points) != len(arrows):
            if old is not None:
                old.remove()
            old = self._scene.add_arrows(
                "/contacts/forces", arrows, FORCE, shaft_radius=0.002, head_radius=0.005, head_length=0.012
            )
        else:
            old.points = arrows
        self._extras["/contacts/forces"] = old

    def _flow(self, matter: Mapping[str, Matter]) -> None:
        gone = [name for name in self._extras if name.startswith("/matter/") and name.split("/")[2] not in matter]
        for name in gone:
            self._extras.pop(name).remove()
        for name, family in matter.items():
            color = np.rint(255 * family.color).astype(int)
            if len(family.faces):
                self._surface(f"/matter/{name}", family, color)
            else:
                self._cloud(f"/matter/{name}", family.points, 2.0 * family.radius, color)

    def _surface(self, name: str, family: Matter, color: Array) -> None:
        node = self._extras.get(name)
        if node is None or len(node.faces) != len(family.faces):
            self._extras[name] = self._scene.add_mesh_simple(
                name, family.points, family.faces, color=tuple(color.tolist()), side="double"
            )
        else:
            node.vertices = np.asarray(family.points, dtype=np.float32)

    def _cloud(self, name: str, points: Array, size: float, color: Array) -> None:
        node = self._extras.get(name)
        if len(points) == 0:
            if node is not None:
                self._extras.pop(name).remove()
        elif node is None:
            self._extras[name] = self._scene.add_point_cloud(
                name, points, color, point_size=size, point_shape="circle", precision="float32"
            )
        else:
            node.points = np.asarray(points, dtype=np.float32)

    # ------------------------------------------------------------------ the view at first

    def _aim(self) -> None:
        """Look from where the world's first camera that stands looks, else from beside all of it."""
        world, start = self.world, self.page.server.initial_camera
        places = world.initial_body_pose[world.initial_presence[self._entity], :3] if world.bodies else np.zeros((1, 3))
        middle = np.median(places, axis=0) if len(places) else np.zeros(3)
        eye = next((np.array(c.position) for c in world.cameras if c.body < 0), None)
        if eye is None:
            reach = max(0.25, float(np.quantile(np.linalg.norm(places - middle, axis=1), 0.9)))
            eye = middle + _EYE * reach * np.array([0.75, -0.75, 0.55])
        else:
            camera = next(c for c in world.cameras if c.body < 0)
            ahead = P.rotate(np.array(camera.quaternion, dtype=float), np.array([0.0, 0.0, 1.0]))
            middle = eye + ahead * max(0.3, float((middle - eye) @ ahead))
            start.fov = float(np.radians(camera.fov))
        start.position, start.look_at = eye, middle


def place(node: Any, pose: Array) -> None:
    """Put a node where a pose (7,) is, unless it is there."""
    wxyz = pose[[6, 3, 4, 5]]
    if not np.allclose(node.position, pose[:3], rtol=0.0, atol=1e-6):
        node.position = pose[:3]
    if not np.allclose(node.wxyz, wxyz, rtol=0.0, atol=1e-6):
        node.wxyz = wxyz
