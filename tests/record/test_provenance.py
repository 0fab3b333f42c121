from importlib import metadata
from types import SimpleNamespace

from anysim.record import header
from anysim.record.header import package_versions


def test_versions_of_what_takes_part():
    versions = package_versions()
    assert versions["anysim"] == metadata.version("anysim")
    assert versions["anysim-schemas"] == metadata.version("anysim-schemas")
    assert versions["numpy"] == metadata.version("numpy")  # required by anysim
    assert versions["pydantic"] == metadata.version("pydantic")  # required by anysim-schemas
    assert list(versions) == sorted(versions)
    assert "pytest" not in versions


def test_what_another_distribution_brings_is_known_by_its_name(monkeypatch):
    """`mujoco-core` is of `anysim-mujoco` what `mujoco` is, and where that is not installed it is listed."""
    has = header._installed
    known = {"mujoco": None, "mujoco-core": SimpleNamespace(version="4.0.1", requires=[])}
    monkeypatch.setattr(header, "_installed", lambda name: known[name] if name in known else has(name))
    monkeypatch.setattr(header.metadata, "packages_distributions", lambda: {"mujoco": ["mujoco_core"]})
    versions = header._versions.__wrapped__(("anysim-mujoco",))
    assert versions["mujoco-core"] == "4.0.1"
    assert "mujoco" not in versions
    assert list(versions) == sorted(versions)
