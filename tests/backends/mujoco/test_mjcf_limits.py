"""MJCF that reaches outside of its root, or unfolds to far more than it is, is refused before MuJoCo reads it."""

import re
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from math import inf
from pathlib import Path

import pytest

from anysim.assets.load import import_asset
from anysim.assets.model import strange_number
from anysim.errors import AssetError
from anysim_mujoco.mjcf.budget import MjcfBudget
from anysim_mujoco.mjcf.load import import_mjcf
from anysim_schemas.limits import (
    GROUND_CELLS,
    MESH_FACES,
    MODEL_BYTES,
    MODEL_COMPOSITE,
    MODEL_DEPTH,
    MODEL_ELEMENTS,
    MODEL_INCLUDE_DEPTH,
    MODEL_INCLUDES,
    MODEL_OCTREE,
    MODEL_SIZE,
    Limit,
)

BODY = '<body name="b"><freejoint/><geom size="0.1"/></body>'
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The root of a model, with a secret beside it."""
    monkeypatch.setenv("ANYSIM_CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "secret.xml").write_text(f"<mujoco><worldbody>{BODY}</worldbody></mujoco>")
    (tmp_path / "secret.obj").write_text(TETRAHEDRON)
    (tmp_path / "root").mkdir()
    return tmp_path / "root"


@pytest.fixture(autouse=True)
def quick() -> Iterator[None]:
    start = time.perf_counter()
    yield
    assert time.perf_counter() - start < 5.0


def refused(root: Path, inner: str, words: str = "model|large", name: str = "model.xml") -> str:
    (root / name).write_text(f'<mujoco model="m">{inner}</mujoco>')
    with pytest.raises(AssetError, match=words) as caught:
        import_mjcf(root / name, root=root)
    return str(caught.value)


def world(inner: str) -> str:
    return f"<worldbody>{inner}</worldbody>"


ATTACH = '<attach model="m" body="b" prefix="p_"/>'


@pytest.mark.parametrize(
    "inner",
    [
        '<asset><model name="m" file="../secret.xml"/></asset>' + world(ATTACH),
        '<asset><model name="m" file="/etc/passwd"/></asset>' + world(BODY),
        '<asset><model name="m" file="link.xml"/></asset>' + world(ATTACH),
        '<asset><model name="m" file="child.xml"/></asset>' + world(ATTACH),
        '<asset><model name="m" file="includes.xml"/></asset>' + world(ATTACH),
        '<include file="../secret.xml"/>',
        world('<body name="b"><flexcomp name="f" type="mesh" file="../secret.obj"/></body>'),
        '<compiler meshdir=".."/>' + world('<body name="b"><flexcomp name="f" type="mesh" file="secret.obj"/></body>'),
        '<asset><hfield name="h" file="../secret.obj" size="1 1 1 1"/></asset>' + world(BODY),
    ],
)
def test_no_reference_leaves_the_root(root: Path, inner: str) -> None:
    (root / "link.xml").symlink_to("../secret.xml")
    mesh = '<asset><mesh name="s" file="../secret.obj"/></asset>'
    (root / "child.xml").write_text(f"<mujoco>{mesh}{world(BODY)}</mujoco>")
    (root / "includes.xml").write_text('<mujoco><include file="../secret.xml"/></mujoco>')
    refused(root, inner, "leaves the asset's root")


def test_a_loop_of_links_is_refused(root: Path) -> None:
    (root / "loop.obj").symlink_to(root / "loop.obj")
    refused(root, world('<body name="b"><flexcomp name="f" type="mesh" file="loop.obj"/></body>'), "cannot be found")


def test_an_attached_model_keeps_its_own_folder(root: Path) -> None:
    (root / "part" / "meshes").mkdir(parents=True)
    (root / "part" / "meshes" / "t.obj").write_text(TETRAHEDRON)
    mesh = '<asset><mesh name="t" file="t.obj"/></asset>'
    body = '<body name="b"><freejoint/><geom type="mesh" mesh="t"/></body>'
    (root / "part" / "part.xml").write_text(f'<mujoco><compiler meshdir="meshes"/>{mesh}{world(body)}</mujoco>')
    path = root / "model.xml"
    path.write_text(f'<mujoco><asset><model name="m" file="part/part.xml"/></asset>{world(ATTACH)}</mujoco>')
    model = import_mjcf(path, root=root)
    assert [body.name for body in model.bodies] == ["p_b"]
    assert len(model.meshes) >= 1


@pytest.mark.parametrize(
    ("inner", "limit"),
    [
        (world(f'<replicate count="2000000" offset="1 0 0">{BODY}</replicate>'), MODEL_SIZE),
        (
            world('<replicate count="999"><replicate count="999"><geom size="1"/></replicate></replicate>'),
            MODEL_ELEMENTS,
        ),
        (world('<body name="b"><composite type="cable" count="1000000 1 1"/></body>'), MODEL_COMPOSITE),
        (world('<body name="b"><flexcomp name="f" type="grid" count="100 100 100"/></body>'), MODEL_COMPOSITE),
        ('<size nuser_body="1000000000"/>' + world(BODY), MODEL_SIZE),
        ('<size nuserdata="1e9"/>' + world(BODY), MODEL_SIZE),
        ('<sensor><user dim="100000000"/></sensor>' + world(BODY), MODEL_SIZE),
        ('<asset><hfield name="h" nrow="50000" ncol="50000" size="1 1 1 1"/></asset>' + world(BODY), GROUND_CELLS),
        ('<asset><mesh name="h" builtin="supersphere" params="1500 1 1"/></asset>' + world(BODY), MESH_FACES),
        ('<asset><mesh name="h" file="t.obj" octree_maxdepth="30"/></asset>' + world(BODY), MODEL_OCTREE),
        (world("<body>" * 300 + "</body>" * 300), MODEL_DEPTH),
        (world("<body/>" * 20_000), MODEL_ELEMENTS),
        ('<asset><hfield name="h" file="large.bin" size="1 1 1 1"/></asset>' + world(BODY), GROUND_CELLS),
        ('<asset><mesh name="h" file="large.stl"/></asset>' + world(BODY), MESH_FACES),
    ],
)
def test_what_unfolds_is_counted_first(root: Path, inner: str, limit: Limit) -> None:
    (root / "large.bin").write_bytes(struct.pack("<ii", 50_000, 50_000))
    (root / "large.stl").write_bytes(bytes(80) + struct.pack("<I", 700_000) + bytes(50 * 700_000))
    assert f"the limit of {limit.thing} is {limit.value:,} {limit.unit}: {limit.remedy}" in refused(root, inner)


def chain(root: Path, levels: int, each: Callable[[int], str]) -> None:
    for level in range(levels):
        (root / f"f{level}.xml").write_text(f"<mujoco>{each(level + 1)}</mujoco>")
    (root / f"f{levels}.xml").write_text("<mujoco/>")


def test_inclusions_are_counted(root: Path) -> None:
    chain(root, 15, lambda n: f'<include file="f{n}.xml"/><include file="f{n}.xml"/>')
    assert MODEL_INCLUDES.remedy in refused(root, '<include file="f0.xml"/>')
    chain(root, 1200, lambda n: f'<include file="f{n}.xml"/>')
    assert MODEL_INCLUDE_DEPTH.remedy in refused(root, '<include file="f0.xml"/>')


def test_attachments_are_counted(root: Path) -> None:
    two = '<attach model="m" body="b" prefix="p_"/><attach model="m" body="b" prefix="q_"/>'
    for level in range(18):
        asset = f'<asset><model name="m" file="f{level + 1}.xml"/></asset>'
        body = f'<body name="b">{two}</body>'
        (root / f"f{level}.xml").write_text(f"<mujoco>{asset}{world(body)}</mujoco>")
    (root / "f18.xml").write_text(f"<mujoco>{world(BODY)}</mujoco>")
    with pytest.raises(AssetError, match="the limit of a model with all that it includes and repeats"):
        MjcfBudget(root / "f0.xml", root).check()


def test_bytes_are_counted(root: Path) -> None:
    with (root / "model.xml").open("wb") as file:
        file.truncate(MODEL_BYTES.value + 1)
    with pytest.raises(AssetError, match=MODEL_BYTES.sentence(MODEL_BYTES.value + 1)):
        import_mjcf(root / "model.xml", root=root)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<!DOCTYPE a [<!ENTITY x \"> <include file='/etc/passwd'/>\">]><mujoco/>", "document type declaration"),
        ('<?xml version="1.0" encoding="UTF-7"?><mujoco/>', "its encoding is not UTF-8"),
        ("<robots/>", "root element <mujoco>"),
    ],
)
def test_what_two_parsers_may_read_differently_is_refused(root: Path, text: str, words: str) -> None:
    (root / "model.xml").write_text(text)
    with pytest.raises(AssetError, match=words):
        import_mjcf(root / "model.xml", root=root)


def test_what_is_attached_is_mjcf(root: Path) -> None:
    (root / "model.urdf").write_text("<robot name='a'/>")
    refused(root, '<asset><model name="m" file="model.urdf"/></asset>' + world(BODY), "must be an MJCF file")
    inner = '<asset><model name="m" file="model.urdf"/></asset>' + world(BODY)
    refused(root, inner, "only to a file called .xml", name="model.mjcf")


def test_memory_for_a_simulation_is_not_set_aside(root: Path) -> None:
    (root / "model.xml").write_text(f'<mujoco><size memory="900G"/>{world(BODY)}</mujoco>')
    assert len(import_mjcf(root / "model.xml", root=root).bodies) == 1


@pytest.mark.parametrize(
    ("inner", "words"),
    [
        ('<geom size="0.1" pos="nan 0 0"/>', "geom 'it.collision0': its position is nan"),
        ('<geom size="0.1" friction="1 nan 0"/>', "geom 'it.collision0': its torsional_friction is nan"),
        ('<geom size="0.1" rgba="1 nan 1 1"/>', "geom 'it.collision0': its color is nan"),
        ('<joint axis="nan 0 1"/><geom size="0.1"/>', "is nan"),
        ('<joint name="turn" damping="nan"/><geom size="0.1"/>', "joint 'turn': its damping is nan"),
        ('<joint name="turn" armature="inf"/><geom size="0.1"/>', "joint 'turn': its armature is inf"),
        ('<joint name="turn" frictionloss="nan"/><geom size="0.1"/>', "joint 'turn': its friction is nan"),
        ('<geom size="0.1"/><site name="tip" pos="0 nan 0"/>', "site 'tip': its position is nan"),
    ],
)
def test_a_number_that_is_none_does_not_enter_a_world(root: Path, inner: str, words: str) -> None:
    """MuJoCo compiles it, with a warning in its log."""
    (root / "it.xml").write_text(f'<mujoco><worldbody><body name="it">{inner}</body></worldbody></mujoco>')
    with pytest.raises(AssetError, match=re.escape(words)):
        import_asset("it.xml", base=root)


def test_limits_may_be_infinite_and_drives_are_named(root: Path) -> None:
    text = """<mujoco><worldbody><body name="it"><joint name="turn"/><geom size="0.1"/></body></worldbody>
        <actuator><position joint="turn" kp="5" kv="{}" forcerange="-3 3"/></actuator></mujoco>"""
    (root / "it.xml").write_text(text.format("1"))
    model = import_asset("it.xml", base=root)
    assert model.joints[0].upper == inf
    assert strange_number(model) == ""
    hints = (model.actuator_hints[0]._replace(effort_limit=inf),)
    assert strange_number(replace(model, actuator_hints=hints)) == ""
    hints = (model.actuator_hints[0]._replace(kp=inf),)
    assert strange_number(replace(model, actuator_hints=hints)) == "the drive of joint 'turn': its kp is inf"
