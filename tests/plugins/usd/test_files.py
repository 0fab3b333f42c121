"""Files of a stage: what they may refer to, what is refused in a sentence, and what other files are read for."""

from pathlib import Path

import numpy as np
import pytest

from anysim.assets.load import import_asset
from anysim.errors import AssetError
from anysim.model.world import Box
from tests.plugins.usd.conftest import HEAD, body, world

pytest.importorskip("pxr", reason="USD files are read by usd-core, which the dependency group `test` has")

CUBE = 'def Cube "c" (prepend apiSchemas = ["PhysicsCollisionAPI"]) {\ndouble size = 2\n}\n'
PROP = HEAD + world(body("prop", CUBE))
REFERENCE = 'def "thing" (prepend references = @{0}@) {{\n}}\n'


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def refers(folder: Path, target: str, arc: str = "references") -> Path:
    return write(folder / "scene.usda", HEAD + REFERENCE.replace("references", arc).format(target))


@pytest.mark.parametrize("arc", ["references", "payload"])
def test_files_of_the_folder_and_below_are_read(tmp_path: Path, arc: str) -> None:
    write(tmp_path / "props/prop.usda", PROP)
    model = import_asset(str(refers(tmp_path, "./props/prop.usda", arc)))
    assert model.geoms[0].shape == Box((1.0, 1.0, 1.0))
    layered = write(tmp_path / "layers.usda", "#usda 1.0\n(\n    subLayers = [@props/prop.usda@]\n)\n")
    assert import_asset(str(layered)).bodies[0].name == "prop"


def test_binary_files_and_packages_are_read(tmp_path: Path) -> None:
    from pxr import Sdf, UsdUtils

    text = write(tmp_path / "prop.usda", PROP)
    Sdf.Layer.FindOrOpen(str(text)).Export(str(tmp_path / "prop.usdc"))
    write(tmp_path / "inner/scene.usda", HEAD + REFERENCE.format("../prop.usda"))
    assert UsdUtils.CreateNewUsdzPackage(str(text), str(tmp_path / "prop.usdz"))
    for ending in ("usdc", "usdz"):
        assert import_asset(str(tmp_path / f"prop.{ending}")).bodies[0].name == "prop"
    assert import_asset(str(refers(tmp_path, "prop.usdz"))).bodies[0].name == "prop"


@pytest.mark.parametrize(
    ("target", "match"),
    [
        ("../outside.usda", "leaves the asset's root"),
        ("{outside}", "leaves the asset's root"),
        ("link.usda", "leaves the asset's root"),
        ("missing.usda", "which does not exist"),
        ("prop.usdz[../../outside.usda]", "which does not exist"),
        ("http://example.org/a.usda", "no servers"),
        ("omniverse://localhost/a.usd", "no servers"),
        ("notes.txt", "which is no USD file"),
    ],
)
@pytest.mark.parametrize("arc", ["references", "payload"])
def test_what_a_file_may_not_refer_to(tmp_path: Path, target: str, match: str, arc: str) -> None:
    outside = write(tmp_path / "outside.usda", PROP)
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "link.usda").symlink_to(outside)
    write(folder / "notes.txt", "nothing")
    with pytest.raises(AssetError, match=match):
        import_asset(str(refers(folder, target.format(outside=outside), arc)))


def test_what_is_in_a_variant_or_below_a_sublayer_may_not_leave_either(tmp_path: Path) -> None:
    write(tmp_path / "outside.usda", PROP)
    other = '"other" (prepend references = @../outside.usda@) {\n}'
    variants = f'def "thing" (prepend variantSets = "v") {{\nvariantSet "v" = {{\n{other}\n}}\n}}\n'
    with pytest.raises(AssetError, match="leaves the asset's root"):
        import_asset(str(write(tmp_path / "mine/a.usda", HEAD + variants)))
    write(tmp_path / "mine/deep/b.usda", HEAD + REFERENCE.format("../../outside.usda"))
    layered = "#usda 1.0\n(\n    subLayers = [@deep/b.usda@]\n)\n"
    with pytest.raises(AssetError, match="leaves the asset's root"):
        import_asset(str(write(tmp_path / "mine/c.usda", layered)))


def test_value_clips_are_refused(tmp_path: Path) -> None:
    clips = 'def "a" (clips = { dictionary default = { asset[] assetPaths = [@/etc/x.usda@]\n} }) {\n}\n'
    with pytest.raises(AssetError, match="prim '/a' has value clips, which are files"):
        import_asset(str(write(tmp_path / "a.usda", HEAD + clips.replace("} }", "}\n}"))))


def test_references_of_references_are_counted_before_they_are_composed(tmp_path: Path) -> None:
    """Twenty levels of ten references each are 1e20 prims, in 2 kB."""
    level = (
        'class "l{0}" {{\n' + "".join(f'def "c{i}" (references = </l{{1}}>) {{{{\n}}}}\n' for i in range(10)) + "}}\n"
    )
    text = HEAD + "".join(level.format(i, i + 1) for i in range(20)) + 'class "l20" {\n}\n' + world(body("a", CUBE))
    with pytest.raises(AssetError, match=r"composed, it has .* elements; the limit of a model"):
        import_asset(str(write(tmp_path / "bomb.usda", text)))


def test_what_refers_to_itself_comes_to_an_end(tmp_path: Path) -> None:
    text = (
        HEAD
        + 'def Xform "a" (references = </a/b>) {\ndef Xform "b" (references = </a>) {\n}\n}\n'
        + world(body("c", CUBE))
    )
    model = import_asset(str(write(tmp_path / "circle.usda", text)))
    assert model.bodies[0].name == "c"
    assert any("stage" in note.where for note in model.report)


@pytest.mark.parametrize(
    ("data", "match"),
    [
        (b"", "is no USD file"),
        (b"PXR-USDC" + b"\0" * 200, "cannot be read as USD"),
        (b"PK\x03\x04" + b"\0" * 40, "cannot be read as a package"),
        (b'#usda 1.0\ndef Xform "a" {\n', "cannot be read as USD: .*Expected }"),
        (b"#usda 1.0\n" + b'def "a" {\n' * 5000, "levels of elements"),
        (b'#usda 1.0\ndef "a" {\n custom int[] x = ' + b"[" * 100_000, "levels of elements"),
        (b"<robot/>", "is no USD file"),
    ],
)
@pytest.mark.parametrize("ending", ["usd", "usda"])
def test_damaged_files_are_refused_in_a_sentence(tmp_path: Path, data: bytes, match: str, ending: str) -> None:
    path = tmp_path / f"a.{ending}"
    path.write_bytes(data)
    with pytest.raises(AssetError, match=match):
        import_asset(str(path))


def outcome(path: Path) -> str:
    """What a file is refused with; empty where it is read."""
    try:
        import_asset(str(path))
    except AssetError as error:
        return str(error)
    return ""


def test_mutated_files_give_a_sentence_or_a_model(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    path = write(tmp_path / "a.usda", PROP)
    good = path.read_bytes()
    for _ in range(150):
        data = bytearray(good)
        for _ in range(int(rng.integers(1, 7))):
            at = int(rng.integers(len(data)))
            if rng.random() < 0.5:
                data[at] = int(rng.integers(256))
            else:
                del data[at : at + int(rng.integers(1, 30))]
        path.write_bytes(data)
        assert len(outcome(path)) < 1500


def test_nothing_is_said_beside_the_report(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """What the library warns of is in the report and not on the terminal."""
    import_asset(str(write(tmp_path / "a.usda", PROP + 'def "x" (references = </nowhere>) {\n}\n')))
    seen = capfd.readouterr()
    assert (seen.out, seen.err) == ("", "")


def test_without_the_library_the_remedy_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import builtins

    from anysim_usd.library import pxr

    real = builtins.__import__

    def without(name: str, *more: object, **own: object) -> object:
        if name.partition(".")[0] == "pxr":
            raise ModuleNotFoundError("No module named 'pxr'", name="pxr")
        return real(name, *more, **own)  # type: ignore[arg-type]

    pxr.cache_clear()
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(AssetError, match=r"usd-core, which is not here .*: pip install 'anysim-usd\[usd\]'"):
        import_asset(str(write(tmp_path / "a.usda", PROP)))
    pxr.cache_clear()


def test_a_read_file_starts_no_threads(tmp_path: Path) -> None:
    threads = Path("/proc/self/task")
    if not threads.is_dir():
        pytest.skip("threads are counted in /proc, which Linux has")
    before = len(list(threads.iterdir()))
    import_asset(str(write(tmp_path / "a.usda", PROP)))
    assert len(list(threads.iterdir())) <= before
