"""Sixteen envs of pick_cube, each with lights, a background, a view and a lens of its own, side by side in one picture.

    python docs/examples/30_randomised_looks.py [PICTURE.png] [ENGINE]

It needs Pillow (`pip install pillow`). Without a name of a file nothing is written.
"""

import sys

import numpy as np

import anysim

OVERRIDES = [
    "world.lights.key={direction: {range: [[-0.8, -0.8, -1.0], [0.8, 0.8, -0.6]]}, intensity: {range: [0.5, 1.0]},"
    " color: {range: [[1.0, 0.75, 0.55], [1.0, 1.0, 1.0]]}}",
    "world.scenery={background: {choice: [black, navy, teal, silver, white, orange, beige]},"
    " ambient: {choice: [[0.2, 0.2, 0.25], [0.35, 0.35, 0.35], [0.4, 0.33, 0.3], [0.5, 0.5, 0.5]]}}",
    "world.objects.table.color={choice: [beige, silver, white, [0.72, 0.62, 0.5], [0.5, 0.38, 0.28],"
    " [0.35, 0.5, 0.55]]}",
    "world.objects.cube.color={choice: [red, orange, blue, purple, gold, teal]}",
    "world.cameras.front={from: {range: [[1.0, -0.6, 0.75], [1.4, 0.6, 1.1]]}, look_at: cube,"
    " look_at_offset: {normal: {mean: [-0.1, 0, 0.1], std: [0.03, 0.03, 0.03]}}, fov: {range: [28, 45]},"
    " exposure: {range: [0.85, 1.15]}, noise: 0.01, size: [200, 150], channels: [rgb]}",
    "record.cameras=[]",
    "task.images={front: {}}",
]

picture = sys.argv[1] if len(sys.argv) > 1 else None
engine = sys.argv[2] if len(sys.argv) > 2 else "mujoco"
with anysim.make("pick_cube", engine=engine, num_envs=16, overrides=OVERRIDES) as env:
    obs, _ = env.reset(seed=7)
    images = obs["images/front"]
    fields = env.engine.camera_fov("front")
    lights = env.engine.get_parameters("light.intensity")[:, 0]

for i in range(4):
    print(f"env {i}: light {lights[i]:.2f}, field of view {fields[i]:.1f} degrees, brightness {images[i].mean():.0f}")
rows = [np.concatenate(list(images[4 * r : 4 * r + 4]), axis=1) for r in range(4)]
if picture:
    from PIL import Image

    Image.fromarray(np.concatenate(rows)).quantize(256).save(picture, optimize=True)
