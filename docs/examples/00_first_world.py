"""A world of one ball and one box, written in Python, dropped on the ground and drawn."""

import anysim

SPEC = {
    "world": {
        "name": "drop",
        "objects": {
            "ball": {"source": {"sphere": 0.1}, "restitution": 0.6, "color": "orange"},
            "box": {"source": {"box": [0.2, 0.2, 0.2]}, "color": "blue"},
        },
        "layout": {"ball": {"position": [0.0, 0.3, 0.8]}, "box": {"on": "terrain", "x": 0.0, "y": -0.3}},
    }
}

world = anysim.compile_world(SPEC)
with anysim.create_simulation("mujoco") as engine:
    engine.create_world(world, num_envs=2)
    ball = engine.index.body("ball")
    for _ in range(5):
        engine.step(100)
        state = engine.get_state()
        print(f"t = {state.time[0]:.1f} s   ball at z = {state.body_pose[0, ball, 2]:.3f} m")
    image = engine.render("default", width=320, height=240)["rgb"]
    print("an image of", image.shape)
