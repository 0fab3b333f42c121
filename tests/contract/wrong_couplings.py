"""Engines that declare tendons, curves and constraints which they do not have; in all else they are MuJoCo."""

from dataclasses import replace
from math import inf

from wrong_physics import Right

from anysim.model.world import ConstraintKind


class ClaimsTendons(Right):
    """Tendons pull at nothing."""

    caught_by = ("test_couplings.py::test_a_tendon_swings_by_the_inertia_along_it",)

    def _spoil(self, world):
        return replace(world, tendons=tuple(replace(t, stiffness=0.0, damping=0.0) for t in world.tendons))


class TautTendons(Right):
    """Tendons pull to the middle of their rest, also inside of it."""

    caught_by = ("test_couplings.py::test_a_tendon_is_slack_inside_of_its_rest",)

    def _spoil(self, world):
        return replace(world, tendons=tuple(replace(t, rest=(sum(t.rest) / 2,) * 2) for t in world.tendons))


class ClaimsTendonLimits(Right):
    """Tendons have no limits, and are held at no length."""

    caught_by = ("test_couplings.py::test_a_tendon_keeps_its_limits_and_its_length",)

    def _spoil(self, world):
        return replace(world, tendons=tuple(replace(t, lower=-inf, upper=inf) for t in world.tendons))


class ClaimsTendonDrives(Right):
    """A drive of a tendon moves its first joint."""

    caught_by = ("test_couplings.py::test_a_drive_pulls_at_all_joints_of_its_tendon",)

    def _spoil(self, world):
        return replace(world, actuators=tuple(replace(a, shares=()) for a in world.actuators))


class ClaimsSpatialTendons(Right):
    """Strings run straight from their first end to their last."""

    caught_by = ("test_couplings.py::test_a_string_through_space_pulls_by_its_length",)

    def _spoil(self, world):
        straight = tuple(replace(t, path=(t.path[0], t.path[-1])) for t in world.spatial_tendons)
        return replace(world, spatial_tendons=straight)


class ClaimsCurves(Right):
    """A follower keeps to the straight part of its curve."""

    caught_by = ("test_couplings.py::test_a_joint_follows_a_curve",)

    def _spoil(self, world):
        straight = (replace(j, mimic=j.mimic and j.mimic._replace(curve=())) for j in world.joints)
        return replace(world, joints=tuple(straight))


class ClaimsConnects(Right):
    """Loops are open."""

    caught_by = ("test_couplings.py::test_a_loop_of_four_bars_swings_as_one",)

    def _spoil(self, world):
        return replace(world, constraints=())


class ClaimsWelds(Right):
    """Welds turn."""

    caught_by = ("test_couplings.py::test_welded_bodies_turn_as_one",)

    def _spoil(self, world):
        return replace(world, constraints=tuple(replace(c, kind=ConstraintKind.CONNECT) for c in world.constraints))


class ClaimsCompliance(Right):
    """Contacts are as stiff as the engine has them."""

    caught_by = ("test_approximations.py::test_an_error_is_no_larger_than_declared",)

    def _spoil(self, world):
        stiff = tuple(replace(g, surface=replace(g.surface, compliance=None)) for g in world.geoms)
        return replace(world, geoms=stiff)
