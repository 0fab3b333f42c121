"""Engines that declare one thing which they do not do; in all else they are MuJoCo. `caught_by` names the tests."""

from dataclasses import replace
from math import inf

import numpy as np
from wrong_physics import Right

from anysim.engine.capability import Capabilities, Capability as C, Support, approximately
from anysim.engine.presence import Lifecycle
from anysim.engine.state import ContactPoints, RayHits
from anysim.model.world import Actuation, BodyKind, HeightFieldShape, MeshShape, Plane
from anysim_mujoco.engine import MujocoEngine


def exactly(*capabilities: C) -> Capabilities:
    """What MuJoCo declares, and these as exact."""
    return Capabilities({**MujocoEngine.capabilities.supported, **dict.fromkeys(capabilities, Support())})


def _static(world, geom):
    return geom.body < 0 or world.bodies[geom.body].kind is BodyKind.STATIC


def _without(world, unwanted):
    """The world, in which some geoms touch nothing."""
    return replace(world, geoms=tuple(replace(g, collides=g.collides and not unwanted(g)) for g in world.geoms))


class ClaimsRigidBodies(Right):
    """Free bodies are fixed where they are."""

    caught_by = ("test_physics.py::test_free_fall", "test_stepping.py::test_a_step_moves_what_moves")

    def _step(self, n_steps, ids):
        before = self._read("body_pose")
        super()._step(n_steps, ids)
        free = np.array([i for i, b in enumerate(self.world.bodies) if b.kind == "free"], dtype=int)
        self._write_bodies(self._all, free, before[:, free], np.zeros((self.num_envs, len(free), 6)))


class ClaimsArticulations(Right):
    """Joints are rigid."""

    caught_by = ("test_physics.py::test_pendulum_period", "test_commands.py::test_position_drive_reaches_its_target")

    def _step(self, n_steps, ids):
        before = self._read("joint_pos")
        super()._step(n_steps, ids)
        self._write_joints(self._all, np.arange(before.shape[1]), before, np.zeros_like(before))


class ClaimsStaticContacts(Right):
    """What moves passes through what is fixed."""

    caught_by = (
        "test_physics.py::test_resting_height",
        "test_filtering.py::test_excluded_things_pass_and_the_others_land",
    )

    def _spoil(self, world):
        return _without(world, lambda geom: _static(world, geom))


class ClaimsMovingContacts(Right):
    """What moves passes through what moves."""

    caught_by = (
        "test_physics.py::test_collisions_keep_momentum",
        "test_filtering.py::test_groups_pass_through_each_other",
    )

    def _spoil(self, world):
        moving = [i for i, body in enumerate(world.bodies) if body.kind is not BodyKind.STATIC]
        pairs = {(a, b) for a in moving for b in moving if a < b}
        return replace(world, excluded_pairs=world.excluded_pairs | pairs)


class ClaimsPlanes(Right):
    """There is no ground."""

    caught_by = ("test_physics.py::test_resting_height", "test_sensing.py::test_contact_sensors_weigh")

    def _spoil(self, world):
        return _without(world, lambda geom: isinstance(geom.shape, Plane))


class ClaimsHeightFields(Right):
    """Height fields hold nothing."""

    caught_by = (
        "test_physics.py::test_heightfields_are_where_they_say",
        "test_ground.py::test_balls_rest_on_their_steps",
    )

    def _spoil(self, world):
        return _without(world, lambda geom: isinstance(geom.shape, HeightFieldShape))


class ClaimsTriangles(Right):
    """Collides the convex hull of a triangle mesh."""

    capabilities = exactly(C.TERRAIN_TRIMESH)
    caught_by = ("test_ground.py::test_balls_rest_on_their_steps",)

    def _spoil(self, world):
        return replace(
            world,
            geoms=tuple(
                replace(g, shape=replace(g.shape, concave=False)) if isinstance(g.shape, MeshShape) else g
                for g in world.geoms
            ),
        )


class ClaimsMeshes(Right):
    """Meshes touch nothing."""

    caught_by = ("test_physics.py::test_a_mesh_rests_on_its_hull",)

    def _spoil(self, world):
        return _without(world, lambda geom: isinstance(geom.shape, MeshShape))


class ClaimsMimics(Right):
    """Joints that should follow go where they like."""

    caught_by = ("test_commands.py::test_mimic_joints_follow",)

    def _spoil(self, world):
        return replace(world, joints=tuple(replace(j, mimic=None) for j in world.joints))


class _Stored(Right):
    """Keeps one parameter beside its library, which does not hear of it."""

    name_of = ""

    def _build(self, world, num_envs):
        super()._build(world, num_envs)
        self._beside = None

    def _set_parameter(self, name, values, ids, indices):
        if name != self.name_of:
            super()._set_parameter(name, values, ids, indices)
            return
        if self._beside is None:
            self._beside = super()._get_parameter(name).copy()
        self._beside[np.ix_(ids, indices)] = values

    def _get_parameter(self, name):
        beside = self._beside if name == self.name_of else None
        return super()._get_parameter(name) if beside is None else beside.copy()


class StoredMass(_Stored):
    """Masses are stored and do nothing."""

    name_of, caught_by = (
        "body.mass",
        ("test_parameters.py::test_mass_matters", "test_parameters.py::test_link_mass_matters"),
    )


class ClaimsJointFriction(_Stored):
    """Dry friction is stored and does nothing."""

    name_of, caught_by = "joint.friction", ("test_parameters.py::test_joint_friction_matters",)


class StoredInertia(_Stored):
    """Inertias are stored and do nothing."""

    name_of, caught_by = "body.inertia", ("test_parameters.py::test_inertia_matters",)


class StoredCentre(_Stored):
    """Centres of mass are stored and do nothing."""

    name_of, caught_by = "body.com", ("test_parameters.py::test_centre_of_mass_matters",)


class StoredFriction(_Stored):
    """Friction is stored and does nothing."""

    name_of, caught_by = "geom.friction", ("test_parameters.py::test_friction_matters",)


class StoredRestitution(_Stored):
    """Restitution is stored and does nothing."""

    name_of, caught_by = "geom.restitution", ("test_matter.py::test_bounce_height_per_env",)


class StoredDamping(_Stored):
    """Damping of joints is stored and does nothing."""

    name_of, caught_by = "joint.damping", ("test_parameters.py::test_damping_matters",)


class StoredArmature(_Stored):
    """Armature is stored and does nothing."""

    name_of, caught_by = "joint.armature", ("test_parameters.py::test_armature_matters",)


class StoredGains(_Stored):
    """Gains are stored and do nothing."""

    name_of, caught_by = "actuator.kp", ("test_parameters.py::test_gains_matter",)


class StoredLimits(_Stored):
    """Effort limits are stored and do nothing."""

    name_of, caught_by = "actuator.effort_limit", ("test_parameters.py::test_effort_limit_matters",)


class StoredGravity(_Stored):
    """Gravity is stored and does nothing."""

    name_of, caught_by = "world.gravity", ("test_parameters.py::test_gravity_matters",)


class ClaimsBodyDamping(_Stored):
    """Damping of free bodies is stored and does nothing."""

    name_of, caught_by = "body.linear_damping", ("test_matter.py::test_linear_damping_is_exponential",)


class ClaimsJointLimits(Right):
    """Joints go as far as they like."""

    caught_by = ("test_commands.py::test_joint_limits_hold", "test_physics.py::test_joint_limits_hold_a_load")

    def _spoil(self, world):
        return replace(world, joints=tuple(replace(j, lower=-inf, upper=inf) for j in world.joints))


class ClaimsCompensation(Right):
    """Everything has weight."""

    caught_by = ("test_commands.py::test_gravity_compensation", "test_declared.py::test_a_compensated_free_body_hovers")

    def _spoil(self, world):
        return replace(world, bodies=tuple(replace(b, gravity_compensation=False) for b in world.bodies))


class CompensatesLinksAlone(Right):
    """Free bodies have weight whatever the World says."""

    caught_by = ("test_declared.py::test_a_compensated_free_body_hovers",)

    def _spoil(self, world):
        bodies = tuple(
            replace(b, gravity_compensation=b.kind == "link" and b.gravity_compensation) for b in world.bodies
        )
        return replace(world, bodies=bodies)


class ClaimsTorsionalFriction(Right):
    """Nothing resists a spin on the spot."""

    caught_by = ("test_approximations.py::test_an_error_is_no_larger_than_declared",)

    def _spoil(self, world):
        plain = tuple(replace(g, surface=replace(g.surface, torsional=False)) for g in world.geoms)
        return replace(world, geoms=plain)


class ClaimsSolverSettings(Right):
    """Settings of a body's own are taken and forgotten."""

    capabilities = exactly(C.SOLVER_SETTINGS)
    caught_by = ("test_declared.py::test_depenetration_speed_is_per_body",)

    def _spoil(self, world):
        return replace(world, bodies=tuple(replace(b, solver=None) for b in world.bodies))


class ClaimsLessError(Right):
    """Declares a tenth of the error that it has."""

    capabilities = Capabilities(
        {
            **MujocoEngine.capabilities.supported,
            C.RESTITUTION: approximately("within {bounce:g} of the coefficient", bounce=0.007),
        }
    )
    caught_by = ("test_approximations.py::test_an_error_is_no_larger_than_declared",)


class SaysABareNumber(Right):
    """Has a number in a note that is not data."""

    capabilities = Capabilities(
        {**MujocoEngine.capabilities.supported, C.RENDER_LIGHTS: Support(False, "within 80 degrees of its direction")}
    )
    caught_by = ("test_approximations.py::test_numbers_of_a_note_are_measured",)


class DeclaresAnOddNumber(Right):
    """Declares an error without a measurement."""

    capabilities = Capabilities(
        {**MujocoEngine.capabilities.supported, C.RESTITUTION: approximately("{charm:g} of charm", charm=0.1)}
    )
    caught_by = ("test_approximations.py::test_declared_errors_are_known_and_finite",)


# ---------------------------------------------------------------------- drives


class ClaimsVelocityControl(Right):
    """Drives in velocity mode hold where they are."""

    caught_by = ("test_commands.py::test_velocity_drive_reaches_its_speed",)

    def _apply_control(self, control):
        super()._apply_control(control._replace(velocity=np.zeros_like(control.velocity)))


class ClaimsEffortControl(Right):
    """Efforts are not heard."""

    caught_by = ("test_commands.py::test_effort_drive_exerts_its_effort", "test_commands.py::test_effort_feeds_forward")

    def _apply_control(self, control):
        super()._apply_control(control._replace(effort=np.zeros_like(control.effort)))


class ClaimsPositionControl(Right):
    """Position targets are not heard."""

    caught_by = ("test_commands.py::test_position_drive_follows_its_law",)

    def _apply_control(self, control):
        super()._apply_control(control._replace(position=np.zeros_like(control.position)))


class ClaimsExplicitActuation(Right):
    """The explicit law is the implicit one."""

    caught_by = ("test_commands.py::test_the_explicit_law_is_of_the_state_before_the_step",)

    def _spoil(self, world):
        physics = world.physics
        if physics.actuation is Actuation.EXPLICIT_PD:
            physics = replace(physics, actuation=Actuation.IMPLICIT_PD)
        return replace(world, physics=physics)


class ClaimsNativeActuation(Right):
    """The library's own drives are not limited."""

    caught_by = ("test_commands.py::test_native_drives_do_what_their_modes_say",)

    def _spoil(self, world):
        if world.physics.actuation is not Actuation.NATIVE:
            return world
        return replace(world, actuators=tuple(replace(a, effort_limit=inf) for a in world.actuators))


class ClaimsVelocityLimits(Right):
    """Drives go as fast as they can."""

    caught_by = ("test_commands.py::test_drives_keep_the_velocity_limit",)

    def _spoil(self, world):
        return replace(world, physics=replace(world.physics, velocity_limits=False))


class ClaimsWrenches(Right):
    """Wrenches are taken and forgotten."""

    caught_by = ("test_commands.py::test_a_wrench_lasts_one_call", "test_parameters.py::test_mass_matters")

    def _apply_wrench(self, wrench):
        super()._apply_wrench(None if wrench is None else np.zeros_like(wrench))


# ---------------------------------------------------------------------- sensing


class ClaimsContactSensors(Right):
    """Contact sensors read zero."""

    caught_by = (
        "test_sensing.py::test_contact_sensors_weigh",
        "test_touch.py::test_a_block_on_a_slope_reads_its_weight",
    )

    def _read(self, name):
        return np.zeros_like(super()._read(name)) if name == "contact_force" else super()._read(name)


class ClaimsContactPoints(Right):
    """Nothing touches anything."""

    caught_by = ("test_sensing.py::test_contact_points",)

    def _contacts(self, ids):
        return ContactPoints.joined([])


class ClaimsRays(Right):
    """Rays hit nothing."""

    caught_by = (
        "test_sensing.py::test_rays_hit_at_their_distance",
        "test_sensing.py::test_rays_hit_the_ground_and_what_moved",
    )

    def _raycast(self, origins, directions, ids):
        return RayHits(np.full(origins.shape[:2], np.inf), np.full(origins.shape[:2], -1))


class _Retouched(Right):
    """Pictures are changed after they are drawn."""

    def _render(self, view, ids, channels):
        return {name: self._retouched(name, image) for name, image in super()._render(view, ids, channels).items()}

    def _retouched(self, name, image):
        raise NotImplementedError


class ClaimsColour(_Retouched):
    """Pictures are grey."""

    caught_by = ("test_sensing.py::test_the_default_camera_shows_the_world",)

    def _retouched(self, name, image):
        return np.full_like(image, 128) if name == "rgb" else image


class ClaimsDepth(_Retouched):
    """Everything is one metre away."""

    caught_by = ("test_sensing.py::test_depth_of_a_wall", "test_sensing.py::test_nothing_to_see_is_far_and_zero")

    def _retouched(self, name, image):
        return np.ones_like(image) if name == "depth" else image


class ClaimsSegmentation(_Retouched):
    """Everything is the ground."""

    caught_by = ("test_sensing.py::test_segmentation_of_boxes",)

    def _retouched(self, name, image):
        return np.zeros_like(image) if name == "segmentation" else image


class ClaimsShadows(Right):
    """Nothing casts a shadow."""

    caught_by = ("test_declared.py::test_things_cast_shadows_away_from_the_light",)

    def _spoil(self, world):
        return replace(world, scenery=replace(world.scenery, shadows=False))


class ClaimsSeveralLights(Right):
    """The first light shines alone."""

    caught_by = ("test_declared.py::test_every_light_adds",)

    def _spoil(self, world):
        return replace(
            world, lights=tuple(replace(x, intensity=x.intensity * (not i)) for i, x in enumerate(world.lights))
        )


class ClaimsLamps(Right):
    """A lamp with a place shines from above, far away."""

    caught_by = ("test_declared.py::test_a_lamp_shines_from_its_place",)

    def _spoil(self, world):
        far = tuple(replace(light, position=None, direction=(0.0, 0.0, -1.0)) for light in world.lights)
        return replace(world, lights=far)


class ClaimsTextures(Right):
    """Textures are stored and not drawn."""

    caught_by = ("test_matter.py::test_a_texture_stands_upright_on_a_side",)

    def _spoil(self, world):
        bare = tuple(replace(geom, texture=None) for geom in world.geoms)
        return replace(world, geoms=bare)


class ClaimsMaterials(Right):
    """Declares exact materials, and a lamp is as dull as the rest."""

    capabilities = exactly(C.MATERIALS)
    caught_by = ("test_matter.py::test_materials_per_env",)

    def _spoil(self, world):
        return replace(world, materials=tuple(replace(m, emission=0.0) for m in world.materials))


# ---------------------------------------------------------------------- snapshots, presence, editing


class ClaimsSnapshots(Right):
    """A snapshot leaves velocities out."""

    caught_by = ("test_snapshots.py::test_a_snapshot_brings_the_state_back",)

    def _restore(self, ids, data, level):
        super()._restore(ids, data, level)
        free = np.array([i for i, b in enumerate(self.world.bodies) if b.kind == "free"], dtype=int)
        if len(free):
            self._write_bodies(ids, free, None, np.zeros((len(ids), len(free), 6)))


class ClaimsExactSnapshots(Right):
    """A snapshot is right to a billionth."""

    caught_by = ("test_snapshots.py::test_continuing_is_exact", "test_loose_bodies.py::test_loose_bodies_go_on_exactly")

    def _restore(self, ids, data, level):
        super()._restore(ids, data, level)
        free = np.array([i for i, b in enumerate(self.world.bodies) if b.kind == "free"], dtype=int)
        if len(free):
            poses = self._read("body_pose")[np.ix_(ids, free)]
            poses[..., 0] += 1e-9
            self._write_bodies(ids, free, poses, None)


class ClaimsToDelete(Right):
    """Says that what leaves is deleted, and retires it."""

    lifecycle = Lifecycle.P1
    caught_by = ("test_declared.py::test_what_the_lifecycle_says_of_leaving_is_so",)


class AddsAtTheOrigin(Right):
    """What is added stands at the origin."""

    caught_by = ("test_editing.py::test_an_added_object_is_there",)

    def _take_rows(self, carried, old):
        super()._take_rows(carried, old)
        new = {body.name for body in self.world.bodies} - {body.name for body in old.bodies}
        here = np.array([i for i, b in enumerate(self.world.bodies) if b.name in new and b.kind == "free"], dtype=int)
        if len(here):
            home = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (self.num_envs, len(here), 1))
            self._write_bodies(self._all, here, home, None)


class AddsGhosts(Right):
    """What is added does not move."""

    caught_by = ("test_editing.py::test_an_added_object_is_there",)
    _ghosts = frozenset[str]()

    def _take_rows(self, carried, old):
        super()._take_rows(carried, old)
        self._ghosts = frozenset({body.name for body in self.world.bodies} - {body.name for body in old.bodies})

    def _step(self, n_steps, ids):
        before = self._read("body_pose")
        super()._step(n_steps, ids)
        still = np.array([i for i, b in enumerate(self.world.bodies) if b.name in self._ghosts], dtype=int)
        if len(still):
            self._write_bodies(self._all, still, before[:, still], None)


class RemovesNothing(Right):
    """What is removed is still in the way."""

    caught_by = ("test_editing.py::test_a_removed_support_is_gone",)

    def _take_rows(self, carried, old):
        super()._take_rows(carried, old)
        gone = {body.name for body in old.bodies} - {body.name for body in self.world.bodies}
        self._held = self._read("body_pose") if gone else None

    def _step(self, n_steps, ids):
        super()._step(n_steps, ids)
        if getattr(self, "_held", None) is not None:
            free = np.array([i for i, b in enumerate(self.world.bodies) if b.kind == "free"], dtype=int)
            self._write_bodies(self._all, free, self._held[:, free], np.zeros((self.num_envs, len(free), 6)))


class NeverStopsRefusing(Right):
    """Refuses every world, so that every test would be skipped."""

    caught_by = ("test_lifecycle.py::test_the_simplest_worlds_are_not_refused",)

    @classmethod
    def refusals(cls, world, options):
        return ["it is Monday"]
