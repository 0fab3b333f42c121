"""Contacts that give way in their own manner: MJCF holds it, and it comes back."""

from pathlib import Path

from anysim_export_model.scene import scene_of
from anysim_export_model.write import write
from anysim_mujoco.mjcf.load import import_mjcf

FILE = """<mujoco><worldbody><body name="block"><freejoint/><geom name="slab" type="box" size="0.1 0.1 0.1" condim="6"
 solref="0.015 0.7" solimp="0.8 0.9 0.02 0.4 3" margin="0.01" gap="0.002" solmix="3"/>
 <geom name="ball" size="0.1" pos="0 0 0.2" condim="1" solref="-500 -20"/></body></worldbody></mujoco>"""


def test_contacts_give_way_as_before(tmp_path: Path) -> None:
    (tmp_path / "block.xml").write_text(FILE)
    before = import_mjcf(tmp_path / "block.xml", root=tmp_path)
    written = write(scene_of(str(tmp_path / "block.xml")), "mjcf", tmp_path / "out")
    after = import_mjcf(written.files[0], root=tmp_path)
    own, back = ([geom.surface for geom in model.geoms if geom.collides] for model in (before, after))
    assert own == back
    assert all(surface.compliance is not None for surface in own)
