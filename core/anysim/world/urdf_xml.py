"""Reading a URDF file safely, with the line of each element for messages."""

from collections import Counter
from io import BytesIO
from pathlib import Path
from typing import Any

from anysim.errors import AssetError

_REQUIRED = {
    "inertia": ("ixx", "iyy", "izz"), "box": ("size",), "sphere": ("radius",), "cylinder": ("radius", "length"),
    "mesh": ("filename",), "mass": ("value",),
}  # fmt: skip
"""Attributes without which the parser would guess (an absent ixx would count as 1 kg m^2) or fail without a line."""


class UrdfFile:
    """A parsed URDF: `robot` is yourdfpy's Robot; `where` names an element with its line."""

    def __init__(self, path: Path) -> None:
        self.path = path
        tree = self._tree(path)
        self._lines: dict[tuple[str, str], int] = {}
        self._check(tree)
        self.robot = self._parse(tree)

    def where(self, kind: str, name: str) -> str:
        """`joint 'wrist' (arm.urdf:48)`."""
        return f"{kind} '{name}' ({self.path.name}:{self._lines.get((kind, name), 0)})"

    def _tree(self, path: Path) -> Any:
        from lxml import etree

        try:
            data = path.read_bytes().rstrip(b"\0 \t\r\n")
        except OSError as error:
            raise AssetError(f"{path}: cannot be read: {error}") from error
        parser = etree.XMLParser(
            resolve_entities=False,
            load_dtd=False,
            no_network=True,
            huge_tree=False,
            remove_comments=True,
            remove_pis=True,
        )
        try:
            root = etree.fromstring(data, parser)
        except etree.XMLSyntaxError as error:
            raise AssetError(f"{path}: not well-formed XML: {error.msg}") from error
        if root.getroottree().docinfo.internalDTD is not None:
            raise AssetError(f"{path}: has a document type declaration (entities), which a URDF does not need")
        if root.tag != "robot":
            raise AssetError(f"{path}: a URDF has the root element <robot>, this one has <{root.tag}>")
        return root

    def _check(self, root: Any) -> None:
        """What the parser would pass over or fail at without naming the place."""
        path = self.path
        for element in root.iter("*"):
            for key, value in element.attrib.items():
                if "$(" in value or "${" in value:
                    raise AssetError(
                        f'{path}:{element.sourceline}: <{element.tag} {key}="{value}"> is an expression of xacro or '
                        "roslaunch that was not expanded; run xacro on the source first"
                    )
        for kind in ("link", "joint"):
            elements = root.findall(kind)
            for element in elements:
                name = element.get("name")
                if not name:
                    raise AssetError(f"{path}:{element.sourceline}: a <{kind}> has no name")
                self._lines[kind, name] = element.sourceline
            twice = [name for name, count in Counter(e.get("name") for e in elements).items() if count > 1]
            if twice:
                raise AssetError(f"{path}: two {kind}s have the name '{twice[0]}'; names must be unique")
        for joint in root.findall("joint"):
            for end in ("parent", "child"):
                element = joint.find(end)
                if element is None or not element.get("link"):
                    raise AssetError(f"{path}:{joint.sourceline}: joint '{joint.get('name')}' names no {end} link")
        for link in root.findall("link"):
            for part in (*link.findall("visual"), *link.findall("collision")):
                geometry = part.find("geometry")
                if geometry is None or len(geometry) == 0:
                    raise AssetError(
                        f"{path}:{part.sourceline}: a <{part.tag}> of link '{link.get('name')}' has no geometry"
                    )
                if geometry[0].tag not in ("box", "sphere", "cylinder", "mesh"):
                    raise AssetError(
                        f"{path}:{geometry[0].sourceline}: link '{link.get('name')}' has a <{geometry[0].tag}>; "
                        "a URDF knows box, sphere, cylinder and mesh"
                    )
            for element in link.iter("*"):
                absent = [key for key in _REQUIRED.get(element.tag, ()) if element.get(key) is None]
                if absent:
                    owner = f"<{element.tag}> of link '{link.get('name')}'"
                    raise AssetError(f"{path}:{element.sourceline}: {owner} lacks {', '.join(absent)}")

    def _parse(self, root: Any) -> Any:
        import logging

        import yourdfpy
        from lxml import etree

        logging.getLogger("yourdfpy").setLevel(logging.ERROR)
        known = etree.Element("robot", name=root.get("name") or self.path.stem)
        for element in root:
            if element.tag in ("link", "joint", "material"):  # transmissions and simulator extensions mean nothing here
                known.append(element)
        try:
            data = BytesIO(etree.tostring(known))
            return yourdfpy.URDF.load(data, load_meshes=False, build_scene_graph=False).robot
        except (ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
            raise AssetError(f"{self.path}: not a valid URDF: {type(error).__name__}: {error}") from error
