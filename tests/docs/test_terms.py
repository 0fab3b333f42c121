"""The page of the terms: what it says with other terms can be said."""

import re
from pathlib import Path
from typing import Any

import yaml

import anysim
from anysim.task.term_registry import bind
from anysim_schemas.task import PredicateTermSpec

ROWS = re.findall(r"^\| .+? \| (`\{.+) \|$", (Path(__file__).parents[2] / "docs/terms.md").read_text(), re.MULTILINE)
SENSORS = {"under": "cube", "left": "panda.panda_leftfinger", "right": "panda.panda_rightfinger", "on_wall": "panda"}
WORLD: dict[str, Any] = {
    "engine": "null",
    "world": {
        "robots": {"panda": {"robot": "franka_panda", "actions": {"arm": "joint_position"}}},
        "objects": {
            "cube": {"source": {"box": [0.04, 0.04, 0.04]}},
            **{name: {"source": {"box": [0.1, 0.1, 0.1]}, "fixed": True} for name in ("base", "table", "wall")},
            "tray": {"source": "procedural:tray"},
            "cabinet": {"source": "procedural:cabinet", "fixed": True},
        },
        "contact_sensors": {name: {"body": body} for name, body in SENSORS.items()},
    },
    "task": {"horizon": 5, "observations": {"policy": ["joint_pos"]}},
}


def test_each_row_of_the_table_is_a_term() -> None:
    texts = [
        text for row in ROWS for text in re.findall(r"`(\{.+?\})`", row) if not re.match(r"\{(range|body): ", text)
    ]
    assert len(texts) >= 8
    places = [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]
    layout = {name: {"position": [5.0, at, 1.0]} for name, at in zip(WORLD["world"]["objects"], places, strict=True)}
    with anysim.make({**WORLD, "world": {**WORLD["world"], "layout": layout}}, num_envs=2) as env:
        env.reset(seed=0)
        for text in texts:
            term = yaml.safe_load(text.replace("$share", "0.5"))
            if "term" in term:
                name = term.pop("term")
                kind = {"stage": "reward", "holds": "observation", "goal_from": "command"}[name]
                bind(kind, name, term, env.scene, text)
            else:
                [(name, params)] = term.items()
                assert bind("predicate", name, params, env.scene, text)().shape == (2,)
                PredicateTermSpec.model_validate({"term": name, **params})
