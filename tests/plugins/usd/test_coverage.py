"""Rows of the table of USD files: each is found in a model, in a world or in a report."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from anysim.assets.model import Fate
from anysim.errors import AssetError

pytest.importorskip("pxr", reason="USD files are read by usd-core, which the dependency group `test` has")

from pxr import Gf, Sdf, Usd, Vt

from anysim_usd import coverage
from anysim_usd.coverage import ROWS, Row
from anysim_usd.load import import_usd
from anysim_usd.scene import read_usd_scene
from anysim_usd.unheld import unread

OUT = [row for row in ROWS if row.fate is Fate.LEFT_OUT]
_JOINT = "PhysicsRevoluteJoint"


def given(prim: Any, name: str) -> Any:
    """An attribute or relationship of a prim that says something else than its schema."""
    definition = prim.GetPrimDefinition()
    if name in definition.GetPropertyNames() and definition.GetSchemaRelationshipSpec(name):
        prim.CreateRelationship(name).SetTargets(["/other"])
        return
    attribute = prim.GetAttribute(name) or prim.CreateAttribute(name, Sdf.ValueTypeNames.Float)
    usual = attribute.Get()
    if usual is None:
        usual = {"bool": False, "token": "", "vector3f[]": Vt.Vec3fArray()}.get(str(attribute.GetTypeName()), 0.0)
    attribute.Set(
        type(usual)(1) if hasattr(usual, "__len__") and len(usual) == 0 and usual != "" else other(usual, name)
    )


def other(value: Any, name: str = "") -> Any:
    """Another value of the same type."""
    match value:
        case bool():
            return not value
        case int():
            return value + 1
        case float():
            return value * 1.25 + 0.125 if abs(value) < 1e9 else 0.5
        case str():
            return TOKENS.get(name.rpartition(":")[2], {}).get(value, f"{value}x")
        case Gf.Vec2f() | Gf.Vec3f() | Gf.Vec3d():
            changed = [other(float(v)) if abs(v) < 1e9 else 0.5 for v in value]
            return type(value)(*changed[:-1], changed[-1] + 0.25)
        case Gf.Quatf() | Gf.Quatd():
            return type(value)(0.6, 0.8, 0.0, 0.0)
        case Gf.Matrix4d():
            return Gf.Matrix4d(value).SetTranslateOnly(Gf.Vec3d(1, 2, 3))
        case _:
            return type(value)([other(one, name) for one in value])


TOKENS = {
    "axis": {"X": "Y", "Y": "Z", "Z": "X"},
    "orientation": {"rightHanded": "leftHanded", "leftHanded": "rightHanded"},
    "type": {"force": "acceleration"},
    "approximation": {"convexHull": "boundingCube"},
    "purpose": {"default": "guide"},
    "visibility": {"inherited": "invisible"},
    "subdivisionScheme": {"catmullClark": "none"},
    "dynType": {"none": "filter"},
    "gainType": {"fixed": "user"},
    "biasType": {"affine": "none"},
    "forceLimited": {"auto": "false"},
    "ctrlLimited": {"auto": "false"},
    "cone": {"pyramidal": "elliptic"},
}


@pytest.mark.parametrize("row", OUT, ids=lambda row: f"{row.path} {row.attributes}".strip())
def test_what_the_table_leaves_out_is_noted(row: Row) -> None:
    """Each type, schema and attribute where it may stand."""
    stage = Usd.Stage.CreateInMemory()
    stage.DefinePrim("/other", "Xform")
    if not row.attributes:
        typed = row.path not in ("SkelBindingAPI",) and not row.path.endswith("API")
        prim = stage.DefinePrim("/it", row.path if typed else "Xform")
        if not typed:
            prim.AddAppliedSchema(row.path)
        found = {what: why for what, why, _ in unread(prim)}
        assert row.text in found[f"prim {row.path}" if typed else f"schema {row.path}"]
        return
    for name in row.attributes.split():
        kind = _JOINT if row.path == "joint" else row.path if row.path in ("Mesh", "Camera") else "Xform"
        if name.startswith("physics:coneAngle"):
            kind = "PhysicsSphericalJoint"
        elif name.startswith("physics:") and name.endswith("Distance"):
            kind = "PhysicsDistanceJoint"
        prim = stage.DefinePrim("/" + re.sub(r"\W", "_", name), kind)
        concrete = name.replace("*", "angular")
        if row.path in ("PhysicsRigidBodyAPI", "PhysicsCollisionAPI"):
            prim.ApplyAPI(row.path)
        if row.path == "PhysicsDriveAPI":
            prim.ApplyAPI("PhysicsDriveAPI", "angular")
        given(prim, concrete)
        lines = list(unread(prim, world=True))
        assert any(what in (concrete, f"prim {kind}") and row.text in why for what, why, _ in lines), (concrete, lines)


def test_what_the_table_does_not_know_is_noted() -> None:
    stage = Usd.Stage.CreateInMemory()
    prim = stage.DefinePrim("/it", "StrangeThing")
    assert list(unread(prim)) == [("prim StrangeThing", "is left out: no type of prim that is known", "it")]
    prim = stage.DefinePrim("/that", "Xform")
    prim.AddAppliedSchema("StrangeAPI")
    prim.CreateAttribute("strange:value", Sdf.ValueTypeNames.Float).Set(1.0)
    prim.CreateAttribute("strange:none", Sdf.ValueTypeNames.Float)
    assert [line[:2] for line in unread(prim)] == [
        ("schema StrangeAPI", "is left out: it is not known"),
        ("strange:value", "is left out: it is not known"),
    ]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A stage with every schema and attribute that the table does not leave out."""
    path = tmp_path_factory.mktemp("whole") / "whole.usda"
    path.write_text((Path(__file__).parent / "whole.usda").read_text("utf-8"), "utf-8")
    return path


def outcome(path: Path) -> Iterator[Any]:
    """What becomes of a stage, one after another: two models, a world, and their reports; or why not."""
    for read in (
        lambda: import_usd(path, root=path.parent, body="arm"),
        lambda: import_usd(path, root=path.parent, body="crate"),
        lambda: import_usd(path, root=path.parent, body="/"),
        lambda: read_usd_scene(path, root=path.parent, uri="whole.usda", packages={}),
    ):
        try:
            yield read()
        except AssetError as error:
            yield str(error).partition(": ")[2]


def said(stage: Any) -> Iterator[tuple[Any, Row]]:
    """The properties of a stage that the table says are read, and their rows."""
    for prim in stage.Traverse():
        for prop in prim.GetAuthoredProperties():
            row = coverage.attribute(str(prop.GetName()), str(prim.GetTypeName()))
            assert row is not None, f"{prop.GetPath()} is in no row"
            if row.fate in (Fate.EXACT, Fate.APPROXIMATED):
                yield prop, row


def test_the_whole_stage_has_each_row_that_is_read(whole: Path) -> None:
    stage = Usd.Stage.Open(str(whole))
    names = {str(prop.GetName()) for prop, _ in said(stage)}
    missing = [
        name
        for row in ROWS
        if row.fate in (Fate.EXACT, Fate.APPROXIMATED) and row.path not in ("stage", "prim", "anysim")
        if row.path != "PhysxSceneAPI"  # MuJoCo's time step counts where both are there
        for name in row.attributes.split()
        if not any(re.fullmatch(re.escape(name).replace(r"\*", ".+"), one) for one in names)
    ]
    assert missing == []
    schemas = {s.partition(":")[0] for prim in stage.Traverse() for s in prim.GetPrimTypeInfo().GetAppliedAPISchemas()}
    kinds = {str(prim.GetTypeName()) for prim in stage.Traverse()}
    whole_rows = [row.path for row in ROWS if row.fate in (Fate.EXACT, Fate.APPROXIMATED) and not row.attributes]
    assert [path for path in whole_rows if path not in schemas | kinds] == []


@pytest.mark.slow
def test_what_the_table_reads_is_in_the_model(whole: Path) -> None:
    """Another value is another model, world or report, or an error that says why not."""
    stage = Usd.Stage.Open(str(whole))
    before = list(outcome(whole))
    assert not any(isinstance(one, str) for one in before), before
    silent: list[str] = []
    changed = whole.with_name("changed.usda")
    for prop, row in list(said(stage)):
        layer = Sdf.Layer.CreateAnonymous(".usda")
        layer.TransferContent(stage.GetRootLayer())
        edited = Usd.Stage.Open(layer)
        mine = edited.GetPropertyAtPath(prop.GetPath())
        if isinstance(mine, Usd.Relationship):
            mine.SetTargets([] if mine.GetTargets() else ["/World/arm"])
        else:
            value = mine.Get()
            if isinstance(value, Vt.TokenArray):
                mine.Set([])
            elif value is not None:
                mine.Set(other(value, str(prop.GetName())))
            else:
                mine.ClearConnections()
        layer.Export(str(changed))
        if all(one == now for one, now in zip(before, outcome(changed), strict=True)):
            silent.append(f"{prop.GetPath()} ({row.path})")
    assert silent == []
