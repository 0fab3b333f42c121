"""A picture of fluid, sand and rice after half a second on three engines, docs/images/matter.jpg.

`python scripts/matter_picture.py` writes it.
"""

from pathlib import Path
from typing import Any

from pictures import side_by_side

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "matter.jpg"
STEPS = 25


def world() -> dict[str, Any]:
    """A tank with a box that floats, a heap of sand and one of rice."""
    from anysim_particles.bench import tank

    made = tank(0.12, 0.08, 0.01)
    made["objects"]["box"] = {"source": {"box": [0.04, 0.04, 0.04]}, "density": 400, "color": "red"}
    made["layout"]["box"] = {"position": [0.02, 0.0, 0.1]}
    made["cameras"] = {"eye": {"look_at": [0.05, -0.02, 0.02], "from": [0.16, -0.28, 0.24], "size": [400, 320]}}
    made["families"] = {
        "water": {"kind": "fluid", "box": [0.12, 0.12, 0.05]},
        "sand": {"kind": "sand", "cylinder": [0.025, 0.08], "position": [0.14, 0.02, 0.0]},
        "rice": {"kind": "rice", "box": [0.04, 0.04, 0.02], "position": [0.06, -0.11, 0.0]},
    }
    return made


if __name__ == "__main__":
    side_by_side(world(), "eye", STEPS).save(PICTURE, quality=85)
