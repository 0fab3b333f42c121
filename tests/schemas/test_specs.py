"""The models themselves: documented, strict where people slip, and whole in another process."""

import pickle  # noqa: TID251  worker processes are sent specs by multiprocessing, which pickles
import subprocess
import sys

import pytest
from pydantic import BaseModel, ValidationError

from anysim_schemas.base import Spec
from anysim_schemas.load import load_run
from anysim_schemas.objects import ObjectSpec
from anysim_schemas.robot_model import RobotModelSpec
from anysim_schemas.run import RunSpec
from anysim_schemas.shapes import inside, shapes_of_field
from anysim_schemas.terrain import TerrainSpec
from anysim_schemas.values import Choice, Normal, Range, Value


def all_models(model, seen=None):
    seen = {} if seen is None else seen
    if model not in seen:
        seen[model] = None
        pending = [shape for name in model.model_fields for shape in shapes_of_field(model, _key(model, name))]
        while pending:
            shape = pending.pop()
            if shape.model is not None:
                all_models(shape.model, seen)
            else:
                pending += inside((shape,), 0)
    return list(seen)


def _key(model, name):
    return model.model_fields[name].alias or name


MODELS = list(dict.fromkeys(all_models(RunSpec) + all_models(RobotModelSpec)))


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_every_spec_and_field_says_what_it_is(model):
    assert issubclass(model, Spec)
    assert model.__doc__
    assert model.__doc__ != BaseModel.__doc__
    assert model.model_config["frozen"]
    assert model.model_config["extra"] in ("forbid", "allow")
    assert [name for name, field in model.model_fields.items() if not field.description] == []


def test_all_specs_are_found():
    assert {"RunSpec", "RewardTermSpec", "Range_positive", "NormalParameters_color", "SurfaceSpec"} <= {
        m.__name__ for m in MODELS
    }


@pytest.mark.parametrize(
    "mass",
    [
        *(
            {"range": ["a", "b"]},
            {"range": [0.1, 0.05]},
            {"range": [-1, 1]},
            {"choice": [1, -1]},
            True,
            "1",
            float("nan"),
        ),
        *({"normal": {"mean": "x", "std": 1}}, {"normal": {"mean": 1, "std": 1, "low": 2, "high": 1}}),
        {"choice": [1], "weights": [0]},
    ],
)
def test_drawn_values_are_checked_to_the_bottom(mass):
    with pytest.raises(ValidationError):
        ObjectSpec.model_validate({"source": {"sphere": 1}, "mass": mass})


def test_drawn_values_keep_their_classes():
    cube = ObjectSpec.model_validate(
        {"source": {"sphere": 1}, "mass": {"range": [1, 2]}, "friction": {"choice": [1]}, "color": {"choice": ["red"]}}
    )
    assert isinstance(cube.mass, Range)
    assert isinstance(cube.friction, Choice)
    assert cube.mass.range == (1.0, 2.0)
    assert type(cube.mass.range[0]) is float
    assert ObjectSpec(source=cube.source, mass=cube.mass).mass is cube.mass, "an instance is taken as it is"


def test_a_value_of_another_kind_can_be_declared():
    class Bin(Spec):
        count: Value[int]

    assert Bin.model_validate({"count": {"range": [1, 3]}}).count == Range[int](range=(1, 3))
    assert isinstance(Bin.model_validate({"count": {"normal": {"mean": 1, "std": 1}}}).count, Normal)


@pytest.mark.parametrize("heights", [[], [[0, 0]], [[0], [0]], [[0, 0], [0]]])
def test_height_fields_have_a_shape(heights):
    with pytest.raises(ValidationError):
        TerrainSpec.model_validate({"kind": "heightfield", "heights": heights})


def test_a_step_that_is_far_too_small_is_refused():
    with pytest.raises(ValidationError, match=r"greater than or equal to 0.000001"):
        RunSpec.model_validate({"physics": {"dt": 1e-320}})


def test_a_spec_survives_another_process(tmp_path):
    spec = load_run(
        {
            "world": {
                "objects": {
                    "c": {"source": "a.stl", "mass": {"range": [1, 2]}, "friction": {"normal": {"mean": 1, "std": 0}}}
                }
            }
        }
    ).spec
    assert pickle.loads(pickle.dumps(spec)) == spec
    (tmp_path / "spec.pickle").write_bytes(pickle.dumps(spec))
    code = "import pickle, sys; print(pickle.load(open(sys.argv[1], 'rb')).world.objects['c'].mass.range)"
    command = [sys.executable, "-c", code, str(tmp_path / "spec.pickle")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "(1.0, 2.0)"


def test_importing_the_package_imports_nothing_heavy():
    code = "import anysim_schemas, anysim_schemas.errors, sys; print({'pydantic', 'yaml', 'numpy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_a_group_without_terms_is_refused():
    groups = {"policy": ["last_action"], "privileged": []}
    with pytest.raises(ValidationError, match="the group `privileged` has no term"):
        RunSpec.model_validate({"task": {"observations": groups}})
