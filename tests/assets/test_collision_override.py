"""Collision geometry that a catalogue entry gives to links."""

from collections.abc import Callable
from math import pi

import pytest
from pydantic import ValidationError

from anysim.assets.model import ImportedModel
from anysim.compile.collisions import with_solids
from anysim.errors import AssetError
from anysim.model.world import Box, Capsule, Cylinder, Sphere
from anysim_schemas.robot_model import SolidSpec

ARM = """
<link name="stand"/><link name="hand">{i}
  <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision>
  <visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
<link name="finger"/>
<joint name="turn" type="continuous"><parent link="stand"/><child link="hand"/><axis xyz="0 0 1"/></joint>
<joint name="weld" type="fixed"><origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/><parent link="hand"/>
  <child link="finger"/></joint>
"""


@pytest.fixture
def arm(urdf: Callable[..., ImportedModel], inertial: Callable[[float], str]) -> ImportedModel:
    return urdf(ARM.format(i=inertial(1.0)))


def test_solids_take_the_place_of_what_a_link_collided_with(arm: ImportedModel) -> None:
    solids = {
        "hand": [SolidSpec(box=(0.2, 0.04, 0.06)), SolidSpec(sphere=0.01, position=(0.0, 0.0, 0.3))],
        "finger": [
            SolidSpec(cylinder=(0.01, 0.05), position=(0.02, 0.0, 0.0), roll_pitch_yaw=(pi / 2, 0.0, 0.0)),
            SolidSpec(capsule=(0.01, 0.05)),
        ],
    }
    model = with_solids(arm, solids)
    touching = {g.name: g for g in model.geoms if g.collides}
    assert {name: g.shape for name, g in touching.items()} == {
        "hand.solid0": Box((0.1, 0.02, 0.03)),
        "hand.solid1": Sphere(0.01),
        "finger.solid0": Cylinder(0.01, 0.025),
        "finger.solid1": Capsule(0.01, 0.025),
    }
    assert touching["finger.solid0"].position == pytest.approx((0.1, 0.02, 0.0)), "in the frame of the link"
    assert [model.geom_links[model.geoms.index(g)] for g in touching.values()] == ["hand", "hand", "finger", "finger"]
    assert [g.shape for g in model.geoms if g.visible] == [Box((0.05, 0.05, 0.05))], "what is seen stays"
    assert model.bodies == arm.bodies, "masses stay"
    assert not any(g.collides for g in with_solids(arm, {"hand": []}).geoms)
    assert with_solids(arm, {}) is arm


def test_a_box_that_is_no_part_of_the_hand_is_gone(
    urdf: Callable[..., ImportedModel], inertial: Callable[[float], str]
) -> None:
    """Without a visual its collision geometry is drawn: it stays where solids take its place, else it goes with it."""
    arm = urdf(ARM.replace("<visual>", "<!--").replace("</visual>", "-->").format(i=inertial(1.0)))
    assert [g.visible for g in arm.geoms] == [True]
    assert with_solids(arm, {"hand": []}).geoms == ()
    assert [(g.visible, g.collides) for g in with_solids(arm, {"hand": [SolidSpec(sphere=0.1)]}).geoms] == [
        (True, False),
        (False, True),
    ]


def test_what_is_wrong_with_solids_is_said(arm: ImportedModel) -> None:
    with pytest.raises(AssetError) as caught:
        with_solids(arm, {"fingers": [SolidSpec(sphere=0.1)]})
    assert str(caught.value) == (
        "collision: 'arm' has no link 'fingers'; did you mean 'finger'? (links: stand, hand, finger)"
    )
    with pytest.raises(ValidationError, match="expected exactly one of box, sphere, cylinder, capsule; got none"):
        SolidSpec()
    with pytest.raises(ValidationError, match="got box and sphere"):
        SolidSpec(box=(1.0, 1.0, 1.0), sphere=1.0)
