"""A scene on Pinocchio and Coal: the planned joints move, everything else stands where a scene has it.

The model holds the planned joints alone. A body's pose relative to the planned joint above it follows from the poses in
a scene, whatever lies between them: fingers, mimic joints, a base that stands elsewhere. So a scene is taken over by
moving placements, and one model serves all envs.
"""

from typing import Any

import numpy as np

from anysim.conventions import WORLD, Array
from anysim.errors import AnysimError, NameLookupError, listing, suggest
from anysim.geometry.coal_solids import coal_hull, coal_solid, coal_triangles
from anysim.kinematics.pinocchio_model import pinocchio, se3
from anysim.math import pose as P
from anysim.model.pairs import could_meet, may_meet
from anysim.model.parts import BodyKind, EntityKind
from anysim.model.shapes import HeightFieldShape, MeshShape, Plane, Shape
from anysim.model.world import Geom, JointType, World
from anysim.planning.motion import Attachment, PlanRequest, Scene

RESTING = 0.002
"""[m] that a held thing may be in what it rests on where a motion begins; engines let contacts sink in by less."""
SLACK = 5e-4
"""[m] deeper that it may get on the way."""
FAR = np.array([0.0, 0.0, -1000.0, 0.0, 0.0, 0.0, 1.0])
"""Where things are that are not there."""


def topology(request: PlanRequest) -> tuple[object, ...]:
    """Requests of one topology share a `PlanningWorld`."""
    held = tuple((one.entity, one.body) for one in request.attached)
    return request.joints, held, frozenset(request.allowed), request.padding


class PlanningWorld:
    """Collision checks of one set of joints, held objects and allowed collisions. For one thread.

    Attributes:
        order: (K,) positions of the request's joints in the order of the model, parents first.
        lower, upper, velocity_limit: (K,) in the request's order.
        model, geometry: Pinocchio's, of the planned joints by their names and of all geoms.
        geoms, padding: (G) the World's geoms in the order of `geometry`, and by how much [m] each is grown.
    """

    def __init__(self, world: World, request: PlanRequest, shapes: dict[object, Any], every_link: bool = False) -> None:
        """`shapes` keeps Coal's hulls of meshes, to be shared between worlds.

        With `every_link` links of one robot may not touch each other either where engines let them pass: most robots
        of the catalogue have no self-collision.

        Raises:
            AnysimError: a joint, body or entity is not known, or a joint that follows another is planned.
        """
        self._world, self._pin = world, pinocchio()
        numbers = {joint.name: number for number, joint in enumerate(world.joints)}
        self.joints = np.array([_number(numbers, name, "joint") for name in request.joints])
        for j in self.joints:
            if world.joints[j].mimic is not None:
                raise AnysimError(f"joint '{world.joints[j].name}' follows another (mimic): leave it out of the plan")
        self.order = np.argsort([world.joints[j].body for j in self.joints])
        picked = [world.joints[j] for j in self.joints]
        self.lower, self.upper = np.array([j.lower for j in picked]), np.array([j.upper for j in picked])
        self.velocity_limit = np.array([j.velocity_limit for j in picked])
        self._moved_by = {world.joints[self.joints[k]].body: int(k) for k in self.order}
        self._anchor_of = self._anchors()
        self._attached = self._holders(request.attached)
        self._build(request, shapes)
        self._pairs(request, every_link)
        self._margins: list[tuple[int, float]] = []
        """Pairs that have to keep a distance, or may be nearer than others, and how much [m]."""
        self._seen: bytes | None = None

    # ------------------------------------------------------------------ building

    def _anchors(self) -> Array:
        """(B,) for each body the body above it (or itself) that a planned joint moves, -1 for none."""
        anchors = np.full(len(self._world.bodies) + 1, -1)
        for b, body in enumerate(self._world.bodies):
            anchors[b] = b if b in self._moved_by else anchors[body.parent] if self._world.body_joint[b] >= 0 else -1
        return anchors

    def _holders(self, attached: tuple[Attachment, ...]) -> dict[int, int]:
        """For each body of held entities the body that holds it."""
        bodies = {body.name: b for b, body in enumerate(self._world.bodies)}
        table: dict[int, int] = {}
        for held in attached:
            number = _number(self._world.entity_numbers, held.entity, "entity")
            entity, holder = self._world.entities[number], _number(bodies, held.body, "body")
            for b in range(entity.body_start, entity.body_stop):
                table[b] = holder
                self._anchor_of[b] = self._anchor_of[holder]
        return table

    def _build(self, request: PlanRequest, shapes: dict[object, Any]) -> None:
        pin, world = self._pin, self._world
        self.model, self._joint_of = pin.Model(), {-1: 0}
        for k in self.order:
            joint = world.joints[self.joints[k]]
            kind = (
                pin.JointModelPrismaticUnaligned
                if joint.type is JointType.PRISMATIC
                else pin.JointModelRevoluteUnaligned
            )
            parent = self._joint_of[int(self._anchor_of[world.bodies[joint.body].parent])]
            added = self.model.addJoint(parent, kind(np.array(joint.axis)), pin.SE3.Identity(), joint.name)
            self._joint_of[joint.body] = added
        self.geometry, self.geoms = pin.GeometryModel(), list[Geom]()
        self.padding: list[float] = []
        self._bodies, self._local = list[int](), list[Array]()
        entities = np.array([*world.body_entity, -1])
        for g, geom in enumerate(world.geoms):
            if not geom.collides:
                continue
            own = geom.body != WORLD and world.entities[entities[geom.body]].kind is EntityKind.ROBOT
            padding = 0.0 if own or geom.body in self._attached else request.padding
            key = (g if isinstance(geom.shape, HeightFieldShape) else geom.shape, padding)
            if key not in shapes:
                shapes[key] = _coal_shape(world, geom.shape, padding)
            joint = self._joint_of[int(self._anchor_of[geom.body])]
            placed = pin.GeometryObject(f"{g}:{geom.name}", joint, pin.SE3.Identity(), shapes[key])
            self.geometry.addGeometryObject(placed)
            self.geoms.append(geom)
            self.padding.append(padding)
            self._bodies.append(geom.body)
            self._local.append(P.pose(geom.position, geom.quaternion))

    def _pairs(self, request: PlanRequest, every_link: bool) -> None:
        """Pairs that move against each other and may meet; not those of one robot that touch when it is at home."""
        pin, world = self._pin, self._world
        bodies = np.array(self._bodies, dtype=int)
        anchors = self._anchor_of[bodies]
        entities = np.array([*world.body_entity, -1])[bodies]
        meet = may_meet(world, bodies)
        if every_link:
            meet |= could_meet(world, bodies) & (entities[:, None] == entities)
        meet &= anchors[:, None] != anchors
        for first, second in request.allowed:
            a, b = self._named(first, bodies, entities), self._named(second, bodies, entities)
            meet &= ~((a[:, None] & b) | (b[:, None] & a))
        for held, holder in self._attached.items():  # what holds it touches it
            a = bodies == held
            b = (bodies == holder) | np.isin(bodies, [c for c, p in enumerate(world.bodies) if p.parent == holder])
            meet &= ~((a[:, None] & b) | (b[:, None] & a))
        for i, j in zip(*np.nonzero(np.triu(meet)), strict=True):
            self.geometry.addCollisionPair(pin.CollisionPair(int(i), int(j)))
        home = Scene(0, world.initial_body_pose, world.initial_presence)
        self._place(home, request.attached)
        own = [
            k for k, pair in enumerate(self.geometry.collisionPairs) if entities[pair.first] == entities[pair.second]
        ]
        data, geometry_data = self.model.createData(), self.geometry.createData()
        initial = np.array([world.joints[j].initial for j in self.joints])
        pin.updateGeometryPlacements(self.model, data, self.geometry, geometry_data, initial[self.order])
        touching = [k for k in own if pin.computeCollision(self.geometry, geometry_data, k)]
        pairs = [(pair.first, pair.second) for pair in self.geometry.collisionPairs]
        self.geometry.removeAllCollisionPairs()
        for k in sorted(set(range(len(pairs))) - set(touching)):
            self.geometry.addCollisionPair(pin.CollisionPair(*pairs[k]))
        robot = np.array([*(entity.kind is EntityKind.ROBOT for entity in world.entities), False])[entities]
        self._between = [
            k
            for k, pair in enumerate(self.geometry.collisionPairs)
            if robot[pair.first] and robot[pair.second] and entities[pair.first] != entities[pair.second]
        ]
        """Pairs of two robots, whose shapes are not grown: each would keep the distance from itself as well."""

    def _named(self, name: str, bodies: Array, entities: Array) -> Array:
        """(P,) bool: which geoms belong to a body or an entity; a geom of the world has a name of its own."""
        world = self._world
        found = [b for b, body in enumerate(world.bodies) if body.name == name]
        if name in world.entity_numbers:
            return entities == world.entity_numbers[name]
        ground = np.array([geom.name == name and geom.body == WORLD for geom in self.geoms])
        if ground.any():
            return ground
        if not found:
            known = [*world.entity_numbers, *(body.name for body in world.bodies)]
            raise NameLookupError(f"there is no body or entity '{name}'{suggest(name, known)}")
        return np.isin(bodies, found)

    # ------------------------------------------------------------------ scenes

    def take(self, scene: Scene, attached: tuple[Attachment, ...]) -> None:
        """Put everything where a scene has it."""
        content = b"".join(np.ascontiguousarray(a).tobytes() for a in (*scene[1:], *(held.offset for held in attached)))
        if content != self._seen:
            self._place(scene, attached)
            self._seen = content

    def _place(self, scene: Scene, attached: tuple[Attachment, ...]) -> None:
        world = self._world
        poses = np.concatenate(
            [scene.body_pose, P.pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))[None]]
        )  # -1 is the world
        for held in attached:
            entity = world.entities[world.entity_numbers[held.entity]]
            holder = next(b for b, body in enumerate(world.bodies) if body.name == held.body)
            root = P.inverse(poses[entity.body_start])
            moved = P.compose(poses[holder], np.asarray(held.offset, dtype=float))
            for b in range(entity.body_start, entity.body_stop):
                poses[b] = P.compose(moved, P.compose(root, poses[b]))
        frames = np.array([self._joint_frame(int(a), poses) for a in range(len(world.bodies))] + [poses[-1]])
        for body, joint in self._joint_of.items():
            if body >= 0:
                link = world.bodies[body]
                rest = P.compose(P.pose(link.position, link.quaternion), self._axis_point(body))
                above = P.inverse(frames[self._anchor_of[link.parent]])
                self.model.jointPlacements[joint] = se3(P.compose(above, P.compose(poses[link.parent], rest)))
        absent = np.append(~scene.present, False)[[*world.body_entity, -1]]
        for placed, body, local in zip(self.geometry.geometryObjects, self._bodies, self._local, strict=True):
            anchor = P.inverse(frames[self._anchor_of[body]])
            placed.placement = se3(FAR if absent[body] else P.compose(anchor, P.compose(poses[body], local)))
        pool = self._pin.BroadPhaseManagerPool_DynamicAABBTreeCollisionManager
        self._pool = pool(self.model, self.geometry, 1)

    def rest(self, start: Array, padding: float) -> None:
        """Keep robots apart, and let held things touch what they rest on at a start (K,), but enter it no deeper.

        Surfaces of triangles have no inside: what rests on one begins in collision.
        """
        pin, pairs = self._pin, self.geometry.collisionPairs
        checked = self._pool.getGeometryDatas()[0]
        self._set_margins(checked, 0.0)
        self._margins = [(k, padding) for k in self._between]
        self._set_margins(checked)
        if not self._attached or not self.hits(start[None])[0]:
            return
        data, geometry_data = self.model.createData(), self.geometry.createData()
        pin.updateGeometryPlacements(self.model, data, self.geometry, geometry_data, start[self.order])
        for k, pair in enumerate(pairs):
            if self._may_rest(pair.first, pair.second) and pin.computeCollision(self.geometry, geometry_data, k):
                deep = -pin.computeDistance(self.geometry, geometry_data, k).min_distance
                if 0.0 <= deep <= padding + RESTING:
                    self._margins.append((k, -deep - SLACK))
        self._set_margins(checked)

    def _may_rest(self, first: int, second: int) -> bool:
        """Whether one of two geoms is held and the other is neither held nor a robot's, and both are solid."""
        world, solid = self._world, True
        for g in (first, second):
            shape = self.geoms[g].shape
            solid &= not isinstance(shape, HeightFieldShape) and not (isinstance(shape, MeshShape) and shape.concave)
        held = [self.geoms[g].body in self._attached for g in (first, second)]
        other = self.geoms[first if held[1] else second].body
        robot = other != WORLD and world.entities[world.body_entity[other]].kind is EntityKind.ROBOT
        return solid and held[0] != held[1] and not robot

    def _set_margins(self, geometry_data: Any, margin: float | None = None) -> None:
        for k, own in self._margins:
            geometry_data.collisionRequests[k].security_margin = own if margin is None else margin

    def _axis_point(self, body: int) -> Array:
        anchor = self._world.joints[self._world.body_joint[body]].anchor
        return P.pose(anchor, (0.0, 0.0, 0.0, 1.0))

    def _joint_frame(self, body: int, poses: Array) -> Array:
        """World pose of the frame of the joint that moves a body; of no use for bodies that no planned joint moves."""
        return P.compose(poses[body], self._axis_point(body)) if body in self._moved_by else poses[body]

    def is_still(self, geom: Geom) -> bool:
        """Whether a geom keeps its place relative to the planned joint above it, unless a static thing is moved."""
        if geom.body == WORLD or geom.body in self._attached:
            return geom.body == WORLD
        return geom.body in self._moved_by or self._world.bodies[geom.body].kind is BodyKind.STATIC

    # ------------------------------------------------------------------ checks

    def hits(self, joint_pos: Array, stop: bool = False) -> Array:
        """(n,) bool: which of n configurations (n, K) collide; with `stop`, only whether any does is right."""
        columns = np.asfortranarray(joint_pos[:, self.order].T)
        found = self._pin.computeCollisionsInParallel(1, self._pool, columns, True, stop)
        return np.asarray(found, dtype=bool)

    def clearance(self, joint_pos: Array) -> float:
        """[m] between what is nearest to each other in a configuration (K,), negative inside; inf without pairs."""
        data, geometry_data = self.model.createData(), self.geometry.createData()
        q = joint_pos[self.order]
        self._pin.computeDistances(self.model, data, self.geometry, geometry_data, q)
        return min((r.min_distance for r in geometry_data.distanceResults), default=float("inf"))

    def touching(self, joint_pos: Array) -> list[tuple[str, str]]:
        """Names of the geoms that collide in a configuration (K,)."""
        data, geometry_data = self.model.createData(), self.geometry.createData()
        self._set_margins(geometry_data)
        self._pin.computeCollisions(self.model, data, self.geometry, geometry_data, joint_pos[self.order], False)
        names = [placed.name.partition(":")[2] for placed in self.geometry.geometryObjects]
        pairs = zip(self.geometry.collisionPairs, geometry_data.collisionResults, strict=True)
        return [(names[pair.first], names[pair.second]) for pair, found in pairs if found.isCollision()]


def _number(table: Any, name: str, kind: str) -> int:
    if name not in table:
        raise NameLookupError(f"there is no {kind} '{name}'{suggest(name, list(table))} ({listing(list(table))})")
    return int(table[name])


def _coal_shape(world: World, shape: Shape, padding: float) -> Any:
    """Coal's shape, grown by the padding."""
    import coal  # pyright: ignore[reportMissingImports]  (found by its .pth file)

    made: Any
    match shape:
        case Plane():
            made = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
        case MeshShape(name, concave):
            mesh = next(m for m in world.meshes if m.name == name)
            made = coal_triangles(mesh.vertices, mesh.faces) if concave else coal_hull(mesh.vertices)
        case HeightFieldShape(name):
            field = next(f for f in world.heightfields if f.name == name)
            made = coal_triangles(*surface_triangles(field.heights, field.size))
        case _:
            made = coal_solid(shape)
    if padding and hasattr(made, "setSweptSphereRadius"):
        made.setSweptSphereRadius(padding)
    made.computeLocalAABB()
    return made


def surface_triangles(heights: Array, size: tuple[float, float]) -> tuple[Array, Array]:
    """Vertices (V, 3) [m] and faces (F, 3) of a height field."""
    rows, columns = heights.shape
    x, y = np.linspace(-size[0] / 2, size[0] / 2, columns), np.linspace(-size[1] / 2, size[1] / 2, rows)
    vertices = np.column_stack([np.tile(x, rows), np.repeat(y, columns), np.asarray(heights, dtype=float).ravel()])
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.column_stack([corner, corner + 1, corner + columns])
    upper = np.column_stack([corner + 1, corner + columns + 1, corner + columns])
    return vertices, np.concatenate([lower, upper])
