"""Other robots for a task: what a file changes for each, and the one that takes the place of the task's own."""

from dataclasses import replace

from anysim_schemas.merging import merge
from anysim_schemas.messages import listing
from anysim_schemas.nodes import Fault, Node
from anysim_schemas.shapes import Shapes

_OWN = ("home", "home_velocity")
"""What a file says of a robot by the names of its joints, which another has not."""


def with_robot(root: Node, shapes: Shapes, faults: list[Fault]) -> Node:
    """The data with the robot that they name in the place of the task's own, and what the file changes for it.

    The names of the alternates stay, and what they change is gone: the result is the same if it is read again.
    """
    chosen, alternates = root.child("robot"), root.child("alternates")
    if alternates is not None and not isinstance(alternates.value, dict):
        return root  # the spec says so
    known = alternates.value if alternates is not None and isinstance(alternates.value, dict) else {}
    if chosen is not None and isinstance(chosen.value, str):
        root = _replaced(root, chosen, known.get(chosen.value) or Node({}, chosen.mark), shapes, faults)
    if alternates is None or not isinstance(root.value, dict):
        return root
    names = {name: replace(node, value={}) if isinstance(node.value, dict) else node for name, node in known.items()}
    return replace(root, value={**root.value, "alternates": replace(alternates, value=names)})


def _replaced(root: Node, chosen: Node, change: Node, shapes: Shapes, faults: list[Fault]) -> Node:
    present, others = _robots(root), _robots(change)
    given = {key: name for key, node in others.items() if (name := node.child("robot")) is not None}
    if not given and all(_kind(node) != chosen.value for node in present.values()):
        if len(present) != 1:
            words = f"`robot` replaces the only robot of a task, and this one has {listing(list(present)) or 'none'}"
            faults.append(Fault(chosen.place, "robot", f"{words}; say which: `world.robots.NAME.robot`"))
            return root
        given = dict.fromkeys(present, chosen)
    gone = Node(None, chosen.mark)
    names = {
        key: Node({"robot": name} | {own: gone for own in _OWN if present[key].child(own) is not None}, name.mark)
        for key, name in given.items()
        if key in present and _kind(present[key]) != name.value
    }
    world = Node({"robots": Node(dict(names), chosen.mark)}, chosen.mark)
    return merge(merge(root, Node({"world": world}, chosen.mark), shapes), change, shapes)


def _robots(root: Node) -> dict[str, Node]:
    world = root.child("world")
    robots = None if world is None else world.child("robots")
    found = {} if robots is None or not isinstance(robots.value, dict) else robots.value
    return {key: node for key, node in found.items() if isinstance(node.value, dict)}


def _kind(robot: Node) -> object:
    name = robot.child("robot")
    return None if name is None else name.value
