"""Picture of garments on three engines: `python scripts/garment_picture.py` writes docs/images/garments.jpg."""

from pathlib import Path
from typing import Any

from pictures import side_by_side

PATH = Path(__file__).parents[1] / "docs" / "images" / "garments.jpg"
STEPS = 40


def world() -> dict[str, Any]:
    """A T-shirt that falls over a ball, and a towel over a bar."""
    bar = {"source": {"box": [0.3, 0.03, 0.03]}, "fixed": True}
    shirt = {"chest": 0.3, "length": 0.36, "sleeve": 0.1, "cuff": 0.12, "neck": [0.12, 0.04]}
    towel = {"kind": "garment", "towel": [0.24, 0.3], "spacing": 0.03, "drag": 2.0, "position": [0.35, 0.05, 0.32]}
    return {
        "objects": {"ball": {"source": {"sphere": 0.09}, "fixed": True}, "bar": {**bar, "color": [0.5, 0.5, 0.5]}},
        "layout": {"ball": {"position": [-0.1, 0.0, 0.09]}, "bar": {"position": [0.35, 0.0, 0.28]}},
        "cameras": {"eye": {"look_at": [0.12, 0.0, 0.12], "from": [0.1, -0.75, 0.55], "size": [400, 320]}},
        "families": {
            "shirt": {
                "kind": "garment",
                "shirt": shirt,
                "spacing": 0.04,
                "position": [-0.1, 0.0, 0.2],
                "areal_density": 0.16,
                "bending": 1e-5,
                "drag": 1.0,
                "color": [0.2, 0.45, 0.7],
            },
            "towel": towel,
        },
    }


if __name__ == "__main__":
    side_by_side(world(), "eye", STEPS).save(PATH, quality=80, optimize=True)
