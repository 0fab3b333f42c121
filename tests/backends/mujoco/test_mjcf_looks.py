"""Appearance in MJCF files: colours, textures, materials."""

from pathlib import Path

from anysim_mujoco.mjcf.load import import_mjcf


def test_a_mesh_that_collides_is_drawn_as_it_is(tmp_path: Path) -> None:
    """Its hull fills what is hollow; the picture does not."""
    notch = "0 0 0  2 0 0  2 1 0  1 1 0  1 2 0  0 2 0  0 0 1  2 0 1  2 1 1  1 1 1  1 2 1  0 2 1"
    (tmp_path / "notch.xml").write_text(
        f"""<mujoco><asset><mesh name="notch" vertex="{notch}" face="{_sides()}"/></asset>
        <worldbody><body name="b"><geom name="g" type="mesh" mesh="notch" mass="1"/></body></worldbody></mujoco>""",
        encoding="utf-8",
    )
    model = import_mjcf(tmp_path / "notch.xml", root=tmp_path)
    assert [(geom.name, geom.collides, geom.visible) for geom in model.geoms] == [
        ("g", True, False),
        ("b.visual0", False, True),
    ]
    corners = {mesh.name: len(mesh.vertices) for mesh in model.meshes}
    assert [corners[geom.shape.mesh] for geom in model.geoms] == [10, 12]  # type: ignore[union-attr]
    assert model.geom_links == ("b", "b")


def _sides() -> str:
    """Faces of an L of twelve corners: its walls, bottom and top."""
    walls = [f"{i} {(i + 1) % 6} {(i + 1) % 6 + 6}  {i} {(i + 1) % 6 + 6} {i + 6}" for i in range(6)]
    ends = ((0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5))
    bottom = [f"{a} {c} {b}" for a, b, c in ends]
    return "  ".join([*walls, *bottom, *(f"{a + 6} {b + 6} {c + 6}" for a, b, c in ends)])
