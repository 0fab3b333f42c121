"""USD files of a few lines, which tests write and read."""

from collections.abc import Callable
from pathlib import Path

import pytest

from anysim.assets.model import ImportedModel

HEAD = '#usda 1.0\n(\n    defaultPrim = "World"\n    metersPerUnit = 1\n    kilogramsPerUnit = 1\n    upAxis = "Z"\n)\n'

Usd = Callable[..., ImportedModel]


@pytest.fixture
def usd(tmp_path: Path) -> Usd:
    """Reads the text of a stage, `head` before it; a brace may stand at the end of a line, which USD does not take."""
    pytest.importorskip("pxr", reason="USD files are read by usd-core, which the dependency group `test` has")

    def read(text: str, body: str = "", head: str = HEAD, **own: float) -> ImportedModel:
        from anysim_usd.load import import_usd

        path = tmp_path / "thing.usda"
        path.write_text(head + text.replace("}", "\n}"), encoding="utf-8")
        return import_usd(path, root=tmp_path, body=body, **own)

    return read


def body(name: str, inside: str = "", mass: float = 1.0, at: str = "(0, 0, 0)", schemas: str = "") -> str:
    """A body with a mass and an inertia; `inside` are more lines of it."""
    return f"""def Xform "{name}" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"{schemas}]) {{
        float physics:mass = {mass}
        float3 physics:diagonalInertia = (0.1, 0.1, 0.1)
        point3f physics:centerOfMass = (0, 0, 0)
        double3 xformOp:translate = {at}
        uniform token[] xformOpOrder = ["xformOp:translate"]
        {inside}
    }}
    """


def joint(name: str, kind: str, first: str, second: str, inside: str = "", schemas: str = "") -> str:
    """A joint between two prims of the world; an empty one is the world itself."""
    applied = f" (prepend apiSchemas = [{schemas}])" if schemas else ""
    ends = "\n".join(f"rel physics:body{i} = </World/{end}>" for i, end in enumerate((first, second)) if end)
    return f'def Physics{kind}Joint "{name}"{applied} {{\n{ends}\n{inside}\n}}\n'


def world(*parts: str) -> str:
    """A world of prims."""
    return 'def Xform "World" {\n' + "\n".join(parts) + "\n}\n"
