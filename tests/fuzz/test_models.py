"""Model files that no exporter wrote: 5,000 mutations of URDF and MJCF files, each imported or refused in a sentence.

Mutations are drawn from the number of the file alone, so that one that fails can be made again:
`pytest tests/fuzz/test_models.py -s -k mjcf`, and `mutated(TEXTS["mjcf"], 1234)`.
"""

import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pytest
from lxml import etree

from anysim.compile.world import compile_world
from anysim_schemas.run import WorldSpec
from tests.fuzz.budget import Tally

pytestmark = pytest.mark.full
COUNTS = {"urdf": 2500, "mjcf": 2500, "sdf": 20_000}

URDF = """<?xml version="1.0"?>
<robot name="arm"><material name="steel"><color rgba="0.5 0.5 0.5 1"/></material>
<link name="base"><inertial><origin xyz="0 0 0.1" rpy="0 0 0"/><mass value="4"/>
  <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
  <visual><origin xyz="0 0 0"/><geometry><mesh filename="tetra.obj" scale="1 1 1"/></geometry><material name="steel"/>
  </visual><collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
<joint name="lift" type="prismatic"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.2" rpy="0 0.1 0"/>
  <axis xyz="0 0 1"/><limit lower="0" upper="0.5" effort="100" velocity="1"/><dynamics damping="1" friction="0.1"/>
  </joint>
<link name="upper"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>
  </inertial><collision><geometry><mesh filename="package://parts/tetra.stl"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="upper"/><child link="hand"/><origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="20" velocity="2"/></joint>
<link name="hand"><inertial><mass value="0.5"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/>
  </inertial><collision><geometry><cylinder radius="0.03" length="0.1"/></geometry></collision></link>
<joint name="left" type="prismatic"><parent link="hand"/><child link="finger"/><axis xyz="1 0 0"/>
  <limit lower="0" upper="0.04" effort="20" velocity="1"/></joint>
<link name="finger"><inertial><mass value="0.05"/><inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5" iyz="0" izz="1e-5"/>
  </inertial><collision><geometry><sphere radius="0.01"/></geometry></collision></link>
<joint name="right" type="prismatic"><parent link="hand"/><child link="thumb"/><axis xyz="-1 0 0"/>
  <limit lower="0" upper="0.04" effort="20" velocity="1"/><mimic joint="left" multiplier="1" offset="0"/></joint>
<link name="thumb"><inertial><mass value="0.05"/><inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5" iyz="0" izz="1e-5"/>
  </inertial></link>
<joint name="tip" type="fixed"><parent link="hand"/><child link="tool"/><origin xyz="0 0 0.1"/></joint>
<link name="tool"/><gazebo reference="hand"><mu1>0.3</mu1></gazebo></robot>
"""
MJCF = """<mujoco model="arm"><compiler angle="degree" autolimits="true"/><option timestep="0.002" gravity="0 0 -9.81"/>
<default><geom rgba="0.5 0.5 0.5 1" friction="0.7 0.01 0.001"/><joint damping="0.3" armature="0.02"/>
  <default class="soft"><geom solref="0.01 1" margin="0.001"/></default></default>
<asset><mesh name="tetra" file="tetra.obj" scale="1 1 1"/><material name="steel" rgba="0.4 0.4 0.4 1"/>
  <texture name="grid" type="2d" builtin="checker" width="8" height="8"/>
  <hfield name="hill" nrow="3" ncol="3" size="1 1 0.5 0.1"/></asset>
<worldbody><light pos="0 0 3"/><geom name="floor" type="plane" size="1 1 1"/>
  <body name="base" pos="0 0 1" euler="0 0 30"><geom type="box" size="0.1 0.1 0.1" material="steel"/>
    <site name="base" pos="0.25 0 0"/>
    <body name="upper" pos="0 0.1 0.2"><joint name="turn" axis="0 1 0" pos="0.02 0 0" range="-90 90" ref="10"/>
      <joint name="roll" axis="1 0 0" range="-90 90"/><inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.01"/>
      <geom class="soft" type="capsule" size="0.03 0.1" pos="0.1 0 0" euler="0 90 0"/>
      <body name="hand" pos="0.3 0 0" quat="1 0 0 0"><geom name="palm" type="mesh" mesh="tetra"/>
        <body name="finger"><joint name="left" type="slide" axis="1 0 0" range="0 0.04" frictionloss="0.1"/>
          <geom type="ellipsoid" size="0.01 0.01 0.02" condim="4"/></body>
        <body name="thumb"><joint name="right" type="slide" axis="-1 0 0" range="0 0.04" stiffness="2"/>
          <geom type="sphere" size="0.01" contype="2" conaffinity="2"/></body>
        <body name="tool" pos="0 0 0.1"><geom type="cylinder" size="0.01 0.02" mass="0.05"/><camera name="eye"/></body>
      </body></body></body></worldbody>
<contact><exclude body1="base" body2="hand"/><pair geom1="palm" geom2="floor" friction="1 1 0.1 0.1 0.1"/></contact>
<equality><joint joint1="right" joint2="left" polycoef="0 1 0 0 0"/></equality>
<tendon><fixed name="both"><joint joint="left" coef="0.5"/><joint joint="right" coef="0.5"/></fixed></tendon>
<actuator><position joint="turn" kp="50" kv="5" forcerange="-20 20"/><motor joint="roll" gear="3" ctrlrange="-2 2"/>
  <general tendon="both" biastype="affine" biasprm="0 -10 -1" gainprm="10"/></actuator>
<sensor><jointpos joint="turn"/></sensor><keyframe><key name="home" qpos="0.1 0 0.02 0.02"/></keyframe></mujoco>
"""
SDF = """<sdf version="1.9"><model name="arm" canonical_link="base"><pose>0 0 1 0 0 0</pose><static>false</static>
<frame name="mount" attached_to="base"><pose relative_to="base">0 0 0.5 0 0.1 0</pose></frame>
<link name="base"><inertial><pose>0 0 0.1 0 0 0</pose><mass>4</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.1</izz>
  </inertia></inertial><visual name="v"><geometry><mesh><uri>tetra.obj</uri><scale>1 1 1</scale></mesh></geometry>
  <material><diffuse>1 0 0 1</diffuse></material><transparency>0.5</transparency></visual>
  <collision name="c"><geometry><box><size>0.2 0.2 0.2</size></box></geometry></collision></link>
<link name="upper"><pose relative_to="turn">0.1 0 0 0 0 0</pose><gravity>false</gravity><inertial><mass>1</mass>
  <inertia><ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial>
  <collision name="c"><pose relative_to="mount"/>
  <geometry><mesh><uri>model://parts/tetra.stl</uri></mesh></geometry><surface><bounce/></surface></collision></link>
<joint name="turn" type="revolute"><pose relative_to="mount" degrees="true">0 0.1 0 0 90 0</pose><parent>base</parent>
  <child>upper</child><axis><xyz expressed_in="mount">0 0 1</xyz><limit><lower>-1</lower><upper>1</upper>
  <effort>20</effort><velocity>2</velocity></limit><dynamics><damping>0.3</damping><friction>0.1</friction>
  <spring_stiffness>2</spring_stiffness></dynamics></axis></joint>
<link name="finger"><pose relative_to="upper">0 0 0.2 0 0 0</pose><inertial><mass>0.1</mass><inertia><ixx>1e-4</ixx>
  <iyy>1e-4</iyy><izz>1e-4</izz></inertia></inertial><collision name="c"><geometry><sphere><radius>0.01</radius>
  </sphere></geometry></collision></link>
<joint name="left" type="prismatic"><parent>upper</parent><child>finger</child><axis><xyz>1 0 0</xyz><limit>
  <lower>0</lower><upper>0.04</upper></limit>
  <mimic joint="turn"><multiplier>0.02</multiplier><offset>0.01</offset></mimic></axis>
  </joint>
<model name="tool" placement_frame="grip"><pose relative_to="upper">0 0 0.3 0 0 0</pose><link name="body"><inertial>
  <mass>0.2</mass></inertial></link><frame name="grip"><pose>0 0 0.1 0 0 0</pose></frame></model>
<include><uri>model://parts</uri><name>bolt</name><pose>0 0 0.1 0 0 0</pose></include>
<joint name="hold" type="fixed"><parent>upper</parent><child>tool</child></joint>
<joint name="tie" type="fixed"><parent>tool::body</parent><child>bolt</child></joint>
<plugin name="p" filename="x.so"/></model></sdf>
"""
PART = '<sdf version="1.9"><model name="part"><link name="piece"/></model></sdf>'
TEXTS = {"urdf": URDF, "mjcf": MJCF, "sdf": SDF}
CORNERS = [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1)]
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]

NUMBERS = ["0", "-1", "nan", "inf", "-inf", "1e300", "-1e300", "1e-300", "1e16", "1e39", "99999999999999999999", "0x10"]
WORDS = [
    "",
    " ",
    "text",
    "true",
    "1 2",
    "1,2,3",
    "0 0 0 0",
    "\u00e9\u4e2d\U0001f916",
    "a" * 5000,
    "a.b.c",
    "%s",
    "'",
    "$(find x)",
]
FILES = ["../../../../etc/passwd", "/dev/zero", "file:///etc/passwd", "package://other/tetra.obj", ".", "tetra.obj/x"]
FILES += [
    "http://example.org/a.stl",
    "x" * 5000,
    "tetra.dae",
    "tetra.stl",
    "package://",
    "package://../a",
    "model.urdf",
]


T = TypeVar("T")


def pick(rng: np.random.Generator, of: Sequence[T]) -> T:
    """One of several, each equally likely."""
    return of[int(rng.integers(len(of)))]


def _attributes(root: Any) -> list[tuple[Any, str]]:
    return [(element, key) for element in root.iter("*") for key in element.attrib]


def _another_text(root: Any, rng: np.random.Generator) -> None:
    """Another text of an element that has one, as those of SDF; else another value."""
    elements = [element for element in root.iter("*") if (element.text or "").strip()]
    if not elements:
        return _another_value(root, rng)
    element = pick(rng, elements)
    parts = element.text.split()
    if re.fullmatch(r"[-+.\de\s]+", element.text) and rng.random() < 0.7:
        parts[rng.integers(len(parts))] = pick(rng, NUMBERS)
        element.text = " ".join(parts)
    else:
        element.text = pick(rng, [*WORDS, *NUMBERS, *FILES, pick(rng, elements).text])
    return None


def _another_value(root: Any, rng: np.random.Generator) -> None:
    element, key = pick(rng, _attributes(root))
    old = element.get(key)
    if old.strip() and re.fullmatch(r"[-+.\de\s]+", old) and rng.random() < 0.7:
        parts = old.split()
        parts[rng.integers(len(parts))] = pick(rng, NUMBERS)
        element.set(key, " ".join(parts))
    else:
        element.set(key, pick(rng, FILES if key in ("file", "filename") else [*WORDS, *NUMBERS, *FILES]))


def _another_reference(root: Any, rng: np.random.Generator) -> None:
    (one, key), (other, theirs) = (pick(rng, _attributes(root)) for _ in range(2))
    one.set(key, other.get(theirs))


def _less(root: Any, rng: np.random.Generator) -> None:
    if rng.random() < 0.5:
        element, key = pick(rng, _attributes(root))
        del element.attrib[key]
    else:
        element = pick(rng, [e for e in root.iter("*") if e is not root])
        element.getparent().remove(element)


def _more(root: Any, rng: np.random.Generator) -> None:
    """A copy of an element, there or elsewhere, once or often."""
    element = pick(rng, [e for e in root.iter("*") if e is not root])
    place = element.getparent() if rng.random() < 0.6 else pick(rng, list(root.iter("*")))
    often, text = pick(rng, [1, 1, 1, 3, 200]), etree.tostring(element)
    for _ in range(often if sum(1 for _ in root.iter()) < 500 else 1):
        place.append(etree.fromstring(text))


def _renamed(root: Any, rng: np.random.Generator) -> None:
    element = pick(rng, [e for e in root.iter("*") if e is not root])
    element.tag = pick(rng, [e.tag for e in root.iter("*")] + ["plane", "capsule", "freejoint", "include", "weld", "x"])


def _renamed_attribute(root: Any, rng: np.random.Generator) -> None:
    element, key = pick(rng, _attributes(root))
    value = element.attrib.pop(key)
    element.set(pick(rng, [name for _, name in _attributes(root)] + ["solimp", "gravcomp", "mocap", "x"]), value)


TREE = (_another_value, _another_value, _another_value, _another_reference, _less, _more, _renamed, _renamed_attribute)
"""Changes of a tree; those that are there more often are drawn so."""


def mutated(text: str, number: int) -> bytes:
    """The file of a number: one to four changes of the tree, and of one in five of the text as well."""
    rng = np.random.default_rng(number)
    root = etree.fromstring(text.encode())
    texts = (_another_text,) * 4 if root.tag == "sdf" else ()
    for _ in range(pick(rng, [1, 1, 2, 4])):
        if not len(root):  # all that could change is gone
            break
        pick(rng, (*TREE, *texts))(root, rng)
    data = etree.tostring(root)
    if rng.random() < 0.8:
        return data
    at = int(rng.integers(len(data)))
    return pick(
        rng,
        [
            data[:at],
            data[:at] + b"\0" + data[at:],
            data[:at] + bytes([int(rng.integers(256))]) + data[at + 1 :],
            data[:at] + data[int(rng.integers(len(data))) :],
            b'<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]>' + data,
            b"<a>" * 3000 + data,
            data.replace(b"link", b"link" * 1000, 1).replace(b"body", b"body" * 1000, 1),
            b'<?xml version="0.0" encoding="utf-16"?>' + data,
        ],
    )


@pytest.mark.parametrize("kind", COUNTS)
def test_every_model_file_is_read_or_refused(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As an object of a world, free or fixed: the importer, repairs, and the placement."""
    monkeypatch.setenv("ANYSIM_CACHE_DIR", str(tmp_path / "cache"))
    folder = tmp_path / "model"
    (folder / "parts").mkdir(parents=True)
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES]
    (folder / "tetra.obj").write_text("\n".join(lines))
    facets = [f"facet normal 0 0 1\nouter loop\n{_vertices(face)}\nendloop\nendfacet\n" for face in FACES]
    (folder / "parts" / "tetra.stl").write_text(f"solid t\n{''.join(facets)}endsolid t\n")
    (folder / "parts" / "model.sdf").write_text(PART)
    file = folder / f"model.{'xml' if kind == 'mjcf' else kind}"

    def imported(data: bytes, fixed: bool) -> None:
        file.write_bytes(data)
        source = {"source": file.name, "fixed": fixed}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numbers of 1e300 overflow on their way to a refusal
            world = compile_world(WorldSpec.model_validate({"objects": {"it": source}}), base=folder)
        parts = repr((world.bodies, world.joints, world.geoms, world.sites, world.actuators))
        assert not re.search(r"[=( ]nan[,)]", parts), "a number that is none is in the World"

    imported(TEXTS[kind].encode(), True)  # the file itself is fine
    tally = Tally(f"mutated {kind} files")
    for number in range(COUNTS[kind]):
        data = mutated(TEXTS[kind], number)
        tally.run(f"{kind} {number}", lambda data=data, number=number: imported(data, number % 2 == 0))
    tally.passed(COUNTS[kind])
    assert tally.accepted > COUNTS[kind] // 10  # else the mutations try the parser of XML alone
    assert tally.refused > COUNTS[kind] // 10


def _vertices(face: tuple[int, ...]) -> str:
    return "\n".join(f"vertex {x} {y} {z}" for x, y, z in (CORNERS[i] for i in face))
