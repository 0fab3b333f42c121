"""Accuracy of tools on a circle: root mean square distances of arms, controllers and engines.

    python benchmarks/tracking.py [--robots franka_panda ur5 …] [--controllers pink_ik …] [--engines mujoco …]

The circle has a radius of 5 cm and is vertical, across the front; its speed grows to 0.2 m/s within half a second.
The distance is that from the tool, as the engine has it after a control step of 20 ms, to the target of that step.
"""

import argparse

from anysim.testing.tracking import Circle, follow

ROBOTS = ("franka_panda", "ur5", "ur10", "xarm7", "kinova_j2")
CONTROLLERS = ("differential_ik", "pink_ik", "mink_ik", "batched_ik", "operational_space")
ENGINES = ("mujoco", "pybullet", "sapien")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", default=ROBOTS)
    parser.add_argument("--controllers", nargs="+", default=CONTROLLERS)
    parser.add_argument("--engines", nargs="+", default=ENGINES)
    parser.add_argument("--radius", type=float, default=Circle().radius, help="[m]")
    parser.add_argument("--seconds", type=float, default=2.0, help="how long the tool moves")
    options = parser.parse_args()
    circle = Circle(radius=options.radius)
    print(f"{'robot':14} {'controller':18} {'engine':9} {'rms mm':>8} {'worst mm':>8} {'turn mrad':>9}")
    for robot in options.robots:
        for controller in options.controllers:
            for engine in options.engines:
                seen = follow(robot, controller, engine, circle, seconds=options.seconds)
                figures = f"{1e3 * seen.rms:8.3f} {1e3 * seen.worst:8.3f} {1e3 * seen.turn:9.3f}"
                print(f"{robot:14} {controller:18} {engine:9} {figures}", flush=True)


if __name__ == "__main__":
    main()
