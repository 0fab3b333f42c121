"""Touch: two pads on the fingers of a hand feel what holds a ball up, and see it."""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import anysim
from anysim.math import pose as P
from anysim.skills.runner import SkillPolicy

ENGINE = sys.argv[1] if len(sys.argv) > 1 else "mujoco"
PAD = "sensor: tactile_pad, size: [0.0175, 0.0185], image: [74, 70]"
PADS = (
    f"left: {{{PAD}, frame: panda.panda_leftfinger, at: [0, 0, 0.04525], turn: [1.5708, 0, 0]}}, "
    f"right: {{{PAD}, frame: panda.panda_rightfinger, at: [0, 0, 0.04525], turn: [-1.5708, 0, 0]}}"
)

overrides = (
    f"world.sensors={{{PADS}}}",
    "world.objects.cube.source={sphere: 0.02}",
    "world.objects.cube.mass=0.2",
    "world.cameras=null",
    "record.cameras=[]",
)
with anysim.make("pick_cube", engine=ENGINE, overrides=overrides) as env:
    policy, sensors = SkillPolicy(env), env.sensors
    assert sensors is not None
    env.reset(seed=1)
    policy.begin(np.array([0]))
    while env.running[0]:
        env.step(policy.act(np.array([0])))
    held = np.zeros(3)
    for side, roll in (("left", 0.5), ("right", -0.5)):
        finger = env.engine.get_state().body_pose[0, env.engine.index.body(f"panda.panda_{side}finger")]
        turn = P.multiply(finger[3:], P.from_axis_angle(np.array([1.0, 0, 0]), np.array(roll * np.pi)))
        force = sensors.reading(side, "force")[0]
        held -= P.rotate(turn, force)
        pressed = (sensors.reading(side, "pressure")[0] > 0).sum()
        print(f"{side}: {-force[2]:.1f} N pressed, {np.hypot(*force[:2]):.2f} N of friction, {pressed} taxels")
    print(f"both lift {held[2]:.2f} N; the ball weighs {0.2 * 9.81:.2f} N")
    Image.fromarray(sensors.reading("left", "image")[0]).resize((280, 296)).save(Path("touch.png"))
