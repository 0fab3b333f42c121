from importlib import metadata

from anysim.record.header import package_versions


def test_versions_of_what_takes_part():
    versions = package_versions()
    assert versions["anysim"] == metadata.version("anysim")
    assert versions["anysim-schemas"] == metadata.version("anysim-schemas")
    assert versions["numpy"] == metadata.version("numpy")  # required by anysim
    assert versions["pydantic"] == metadata.version("pydantic")  # required by anysim-schemas
    assert list(versions) == sorted(versions)
    assert "pytest" not in versions
