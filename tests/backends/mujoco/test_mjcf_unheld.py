"""Notes of an MJCF import: what a file says is read, noted, or in a table of what cannot matter."""

import re
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from anysim.assets.model import Fate, ImportedModel
from anysim_mujoco.mjcf import coverage, unheld
from anysim_mujoco.mjcf.load import import_mjcf

ROBOT = """<mujoco><option {option}>{flag}</option>{asset}
<default><default class="soft">{default}</default></default>
<worldbody>{world}<body name="base" {base}>{top}<geom name="trunk" size="0.1" mass="1" {trunk}/>
  <body name="arm" pos="0 0 0.3"><joint name="turn" {joint}/><geom name="rod" size="0.05" mass="1" {rod}/>
    <body name="hand" pos="0 0 0.3"><joint name="grip"/><geom name="fist" size="0.05" mass="1"/>{inner}</body>
  </body></body></worldbody>{rest}</mujoco>"""
PLACES = ("option", "flag", "asset", "default", "world", "base", "top", "trunk", "joint", "rod", "inner", "rest")
KINDS = sorted({*coverage.FIELDS} - {"option"})
SINCE_4 = frozenset({"joint springyield", "geom castshadow", "tendon springyield", "key plastic"})
"""Fields that elements of MuJoCo 3 do not have."""


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., ImportedModel]:
    """`load(joint='…')`: the robot with these additions, imported."""
    monkeypatch.setenv("ANYSIM_CACHE_DIR", str(tmp_path / "cache"))

    def read(**parts: str) -> ImportedModel:
        path = tmp_path / "model.xml"
        path.write_text(ROBOT.format(**(dict.fromkeys(PLACES, "") | parts)), encoding="utf-8")
        return import_mjcf(path, root=tmp_path)

    return read


def test_a_plain_file_has_no_notes(load: Callable[..., ImportedModel]) -> None:
    assert load().report == ()


@pytest.mark.parametrize(
    ("place", "text", "words"),
    [
        ("option", 'density="1.2"', "option density: 1.2 is left out: `engine.options` of MuJoCo has them"),
        ("option", 'viscosity="1e-5"', "option viscosity: 1e-05 is left out"),
        ("option", 'wind="0 1 0"', "option wind: 0 1 0 is left out"),
        ("option", 'gravity="0 0 -1"', "option gravity: 0 0 -1 is left out: the world's `physics` has it"),
        ("option", 'timestep="0.01"', "option timestep: 0.01 is left out: the world's `physics` has it"),
        ("option", 'o_margin="0.1"', "option o_margin: 0.1 is left out"),
        (
            "flag",
            '<flag gravity="disable" contact="disable"/>',
            "disable: contact, gravity: is left out: the world's `physics` has gravity, the",
        ),
        ("flag", '<flag filterparent="disable"/>', "option flag disable: filterparent"),
        ("flag", '<flag override="enable"/>', "option flag enable: override"),
        ("rest", '<contact><pair geom1="trunk" geom2="fist" gap="1"/></contact>', "pairs: meet with what their"),
        ("trunk", 'contype="2" conaffinity="4"', "geom contype: 2 and conaffinity 4 hold inside of the model"),
        ("joint", 'range="10 90"', "turn: starts at 0, outside of [0.174533, 1.5708]; now at the limit (repaired)"),
        ("joint", 'damping="0.1 0.2 0.3"', "joint damping: is a polynomial; its linear part alone is kept"),
        ("joint", 'actuatorfrcrange="-1 5"', "joint actfrcrange: [-1, 5] is one-sided; the larger end limits both"),
        ("joint", 'stiffness="5 1"', "joint stiffness: is a polynomial; its linear part alone is kept"),
        ("top", '<joint name="free" type="free" damping="2" armature="0.1"/>', "joint armature: a free joint has none"),
        ("top", '<joint name="free" type="free" damping="2"/>', "joint damping: a free joint has none here (1: free)"),
        (
            "rest",
            '<keyframe><key name="up" qpos="1 0"/></keyframe>',
            "key qpos: are not kept: only the keyframe 'home'",
        ),
        ("rest", '<keyframe><key name="home" qpos="1 0" qvel="1 0"/></keyframe>', "key qvel: 1 0 is left out"),
        ("asset", '<asset><texture name="t" builtin="flat" type="2d" width="4" height="4"/></asset>', "textures: are"),
        ("inner", '<camera name="eye"/>', "cameras: are left out: those of a world are its own (1: eye)"),
        ("inner", "<light/>", "lights: are left out"),
        ("rest", '<sensor><jointpos name="s" joint="turn"/></sensor>', "sensors: a jointpos is left out: the state"),
        ("rest", '<actuator><motor joint="turn" ctrlrange="-1 2"/></actuator>', "actuator ctrlrange: [-1, 2] is one-"),
        (
            "rest",
            '<actuator><general joint="turn" gainprm="5" biastype="affine" biasprm="3" ctrlrange="-1 2"/></actuator>',
            "actuator ctrlrange: [-1, 2] is one-",
        ),
        ("rest", '<actuator><position joint="turn" kp="1" delay="0.1" nsample="9"/></actuator>', "actuator delay: 0.1"),
        ("rest", '<equality><joint joint1="grip" active="false"/></equality>', "equality active: is inactive"),
        ("world", '<site name="goal"/>', "world: 1 sites of the world beside the model are left out"),
        ("rest", '<custom><numeric name="n" data="1"/></custom>', "numerics: are left out"),
        ("trunk", 'user="1 2"', "geom userdata: 1 2 is left out"),
    ],
)
def test_what_is_left_out_is_named(load: Callable[..., ImportedModel], place: str, text: str, words: str) -> None:
    found = [str(note) for note in load(**{place: text}).report]
    assert any(words in note for note in found), found


def actuators(*drives: str) -> str:
    return f"<actuator>{''.join(drives)}</actuator>"


@pytest.mark.parametrize(
    ("place", "text", "notes"),
    [
        (
            "rest",
            actuators('<general name="a" joint="turn" gainprm="9" biastype="affine" biasprm="3 -9 -1"/>'),
            ["adds a constant force of 3"],
        ),
        ("rest", actuators('<motor name="a" joint="turn" gear="0"/>'), ["has a gear of 0: it moves nothing"]),
        (
            "rest",
            actuators('<motor name="a" joint="turn"/>', '<motor name="b" joint="turn"/>'),
            ["turn: has several drives in its file; none of them is used (dropped)"],
        ),
        (
            "rest",
            actuators('<position name="a" joint="turn" kp="9" ctrlrange="-1 2"/>'),
            ["actuator 'a': has the ctrlrange [-1, 2], which is left out as limits of a target position"],
        ),
        (
            "rest",
            actuators('<velocity name="a" joint="turn" kv="9" ctrlrange="-1 1"/>'),
            ["actuator 'a': has the ctrlrange [-1, 1], which is left out as limits of a target velocity (dropped)"],
        ),
        ("rod", 'solref="0 1"', ["geom solref: 0 1 mixes two forms: the default holds, as in MuJoCo"]),
        ("rod", 'solref="0.1 -1"', ["geom solref: 0.1 -1 mixes two forms"]),
        ("joint", 'solimplimit="0.5 0.6"', []),
        ("joint", 'frictionloss="1" solreffriction="0.1 -1"', ["joint solref_friction: 0.1 -1 mixes two forms"]),
    ],
)
def test_notes_say_what_happens(load: Callable[..., ImportedModel], place: str, text: str, notes: list[str]) -> None:
    """As many notes as faults, and none of what has no effect in MuJoCo either."""
    found = [str(note) for note in load(**{place: text}).report]
    assert len(found) == len(notes), found
    assert all(words in note for words, note in zip(notes, found, strict=True)), found


@pytest.mark.parametrize(
    ("share", "words"), [(2, "2 of its weight, now of all"), (-1, "-1 of its weight, now of none")]
)
def test_partial_gravity_compensation_is_all_or_none(
    load: Callable[..., ImportedModel], share: int, words: str
) -> None:
    tip = f'<body name="tip" gravcomp="{share}"><joint name="bend"/><geom size="0.05" mass="1"/></body>'
    found = [str(note) for note in load(inner=tip).report]
    assert any(words in note for note in found), found


def test_what_mujoco_warns_of_is_noted(tmp_path: Path) -> None:
    """An attribute that it will read no more one day."""
    path = tmp_path / "heavy.xml"
    body = '<body name="a"><freejoint/><geom size="0.1"/></body>'
    path.write_text(f'<mujoco><compiler settotalmass="3"/><worldbody>{body}</worldbody></mujoco>')
    model = import_mjcf(path, root=tmp_path)
    assert abs(model.bodies[0].inertial.mass - 3.0) < 1e-9
    (note,) = model.report
    assert str(note).startswith("MuJoCo: warns: compiler attribute 'settotalmass' is deprecated")


def test_a_mixed_solref_is_as_soft_as_the_default(load: Callable[..., ImportedModel]) -> None:
    model = load(rod='solref="0.1 -1"', joint='range="-9 9" solreflimit="0.1 -1"')
    assert {geom.surface.softness for geom in model.geoms} == {0.0}
    assert {joint.limit_softness for joint in model.joints} == {0.0}


def test_defaults_count_where_they_are_used(load: Callable[..., ImportedModel]) -> None:
    """A class sets a number of a program's own; two geoms are of it, of which one says otherwise."""
    model = load(default='<geom adhesion="0.5"/>', trunk='class="soft"', rod='class="soft" adhesion="0"')
    assert [str(note) for note in model.report] == [
        "geom adhesion: 0.5 is left out: surfaces do not stick (1: trunk) (dropped)"
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_every_field_of_mujoco_is_in_the_table_and_noted_where_it_says_so(kind: str) -> None:
    """Each field of each element is set to what is not its default: there is a note where the table leaves it out."""
    spec = mujoco.MjSpec()
    fields = unheld.fields_of(unheld.pristine(kind))
    named = {name for row in coverage.FIELDS[kind] for name in row.names.split()}
    if mujoco.__version__.startswith("3."):
        named -= {name for name in named if f"{kind} {name}" in SINCE_4}
    assert named - {"name"} == {*fields} - {"name"}
    for field in fields:
        row = coverage.fate(kind, field)
        if row is None or row.fate is not Fate.LEFT_OUT or (kind, field) in unheld.PARTLY:
            continue
        element = _element(spec, kind)
        before = unheld.value_of(element, field)
        _change(element, field)
        if unheld.value_of(element, field) == before:
            pytest.fail(f"{kind}.{field} cannot be changed by this test; change it here")
        noted = {note.where for note in [*unheld.early(spec), *unheld.late(spec)]}
        assert f"{kind} {field}" in noted
        spec.delete(element)


def test_what_is_noted_in_part_is_no_exact_row() -> None:
    fates = {key: row.fate for key in unheld.PARTLY if (row := coverage.fate(*key)) is not None}
    assert {*fates} == {*unheld.PARTLY}
    assert {*fates.values()} <= {Fate.APPROXIMATED, Fate.LEFT_OUT}


def _element(spec: mujoco.MjSpec, kind: str) -> object:
    if kind in ("joint", "geom", "site"):
        body = next((b for b in spec.bodies if b.name == "own"), None) or spec.worldbody.add_body(name="own")
        return getattr(body, f"add_{kind}")()
    return spec.worldbody.add_body() if kind == "body" else getattr(spec, f"add_{kind}")()


def _change(element: object, field: str) -> None:
    value = getattr(element, field)
    if isinstance(value, np.ndarray):
        setattr(element, field, np.where(np.isnan(value), 0.0, value) + 1)
    elif isinstance(value, bool):
        setattr(element, field, not value)
    elif isinstance(value, mujoco.mjtLimited):
        setattr(element, field, 1)
    elif isinstance(value, int | float):
        setattr(element, field, type(value)(2 if value != value else value + 2))
    elif isinstance(value, str):
        setattr(element, field, "x")
    elif hasattr(value, "plugin_name"):
        value.active, value.plugin_name = True, "mujoco.pid"
    else:
        setattr(element, field, [1.0])


def test_every_option_of_mujoco_is_noted() -> None:
    usual = mujoco.MjSpec().option
    named = {name for row in coverage.FIELDS["option"] for name in row.names.split()}
    assert named == {*unheld.fields_of(usual)}
    for field in unheld.fields_of(usual):
        spec = mujoco.MjSpec()
        value = getattr(spec.option, field)
        setattr(spec.option, field, value + 1)
        assert [note.where.split()[0] for note in unheld.late(spec)] == ["option"], field


def schema() -> dict[str, set[str]]:
    """The elements of MJCF by path, with their attributes, as MuJoCo itself prints them."""
    found: dict[str, set[str]] = {}
    above: list[str] = []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        start = re.match(r"( *)([()\w]+) \([!*?R]\) *", line)
        if start is not None:
            depth, tag = len(start[1]) // 3, start[2].replace("(world)", "")
            above = [*above[:depth], tag]
        found.setdefault("/".join(above), set()).update(line[start.end() if start else 0 :].split())
    return found


WITHIN = {"sensor", "composite", "flexcomp", "tendon", "visual", "deformable", "plugin", "skin"}
"""Elements whose fate all that is in them shares."""
COMMON = {"name", "class", "group", "childclass"}
"""Names, defaults, and a switch of MuJoCo's viewer."""


def test_every_element_and_attribute_of_mujoco_is_in_the_table() -> None:
    """MuJoCo's own schema, whose new elements and attributes need a decision."""
    kinds = {"motor": "actuator", "position": "actuator", "velocity": "actuator", "general": "actuator"}
    kinds |= {"freejoint": "joint", "inertial": "body", "compiler": "", "size": ""}
    known = {
        kind: {name for row in own for field in row.names.split() for name in coverage.attributes(kind, field)}
        for kind, own in coverage.FIELDS.items()
    }
    known["body"] |= {name.removeprefix("inertial/") for name in known["body"]}
    missing = []
    seen = set()
    for path, attributes in schema().items():
        tag = path.rpartition("/")[2]
        parts = path.split("/")
        if {*parts[1:-1]} & WITHIN:
            continue
        kind = "equality" if parts[-2:-1] == ["equality"] and tag == "joint" else kinds.get(tag, tag)
        if kind not in coverage.FIELDS:
            if coverage.whole(tag) is None and tag not in ("default",):
                missing.append(path)
            continue
        if coverage.whole(tag) is not None and tag not in kinds and tag != "equality":
            continue
        missing += [f"{path} {name}" for name in sorted(attributes - known[kind] - COMMON)]
        seen |= attributes & known[kind]
    assert missing == []
    assert len(seen) > 100


TENDONS = """<tendon><fixed name="look"><joint joint="turn" coef="1"/></fixed>
<fixed name="pull" stiffness="5" damping="1"><joint joint="grip" coef="1"/></fixed>
<fixed name="stop" limited="true" range="0 1"><joint joint="turn" coef="1"/></fixed>
<fixed name="haul"><joint joint="turn" coef="1"/></fixed>
<fixed name="tied"><joint joint="grip" coef="1"/></fixed>
<spatial name="cord" stiffness="3"><site site="near"/><site site="far"/></spatial></tendon>
<actuator><motor name="winch" tendon="haul"/></actuator><equality><tendon tendon1="tied"/></equality>"""


def test_tendons_that_only_measure_are_left_out(load: Callable[..., ImportedModel]) -> None:
    """All others are in the model, also one through space between what is fixed to the file's world."""
    model = load(rest=TENDONS, world='<site name="near"/><site name="far" pos="1 0 0"/>')
    assert [str(note) for note in model.report if note.where == "tendons"] == [
        "tendons: do nothing in the file either: they only measure (1: look) (info)"
    ]
    assert [tendon.name for tendon in model.tendons] == ["pull", "stop", "tied"]
    assert (model.tendons[2].lower, model.tendons[2].upper) == (0.0, 0.0)
    assert [tendon.name for tendon in model.spatial_tendons] == ["cord"]
    assert [hint.joint for hint in model.actuator_hints] == [0]
