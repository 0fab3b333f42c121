"""Changes of the keys of the layout, and of values that are drawn."""

from tests.schemas.keys.row import Row, row


def ball(change: str, place: str = "on: table", *given: str) -> Row:
    """A change of the place of a ball, among a table and a red box."""
    return row(
        f"world.layout.ball.{change}", given=(*given, "world.layout.ball=null", f"world.layout.ball={{{place}}}")
    )


def mass(change: str, value: str = "range: [0.1, 0.4]") -> Row:
    """A change of a mass that is drawn."""
    return row(f"world.objects.red.mass.{change}", given=f"world.objects.red.mass={{{value}}}", seen="episode")


NORMAL = "normal: {mean: 0.2, std: 0.05, low: 0.01, high: 9.0}"
BIN = "world.objects.table.source={procedural: cabinet}"
PLAN = "world.layout_source={proposal: $FILES/plan.json}"
BAD = "world.layout_source={proposal: $FILES/plan.json, repair: {drop: 0.0}, on_refusal: layout}"
ABOVE = "world.objects.roof={source: {box: [0.6, 0.6, 0.02]}, fixed: true}", "world.layout.roof={position: [0, 0, 1.0]}"

CONE = "world.objects.cone={source: {sphere: 0.05}}", "world.layout.cone={position: [0.4, -0.4, 0.45]}"

ROWS: dict[str, Row] = {
    "Distribution.ratio": mass("ratio=0.4"),
    "Distribution.otherwise": mass("otherwise=7.0", "range: [0.1, 0.4], ratio: 0.4"),
    "Distribution.shared": mass("shared=weights"),
    "Range.range": mass("range=[0.1, 0.5]"),
    "LogUniform.log_uniform": mass("log_uniform=[0.1, 0.5]", "log_uniform: [0.1, 0.4]"),
    "Choice.choice": mass("choice=[0.3, 0.4]", "choice: [0.1, 0.2]"),
    "Choice.weights": mass("weights=[1, 0]", "choice: [0.1, 0.2]"),
    "Normal.normal": mass("normal={mean: 0.4, std: 0.05}", "normal: {mean: 0.2, std: 0.05}"),
    "NormalParameters.mean": mass("normal.mean=0.4", NORMAL),
    "NormalParameters.std": mass("normal.std=0.1", NORMAL),
    "NormalParameters.low": mass("normal.low=0.21", NORMAL),
    "NormalParameters.high": mass("normal.high=0.19", NORMAL),
    "PlaceFields.position": ball("position=[0.1, 0, 2]", "position: [0, 0, 2]"),
    "PlaceFields.on": ball("on=terrain", "on: table, x: 0.1, y: 0.1"),
    "PlaceFields.in_": ball("in=table.drawer_2", "in: table.drawer_1", BIN),
    "PlaceFields.under": ball("under=roof", "on: table", *ABOVE),
    "PlaceFields.x": ball("x=0.2"),
    "PlaceFields.y": ball("y=0.2"),
    "PlaceFields.region": ball("region={circle: {radius: 0.1}}"),
    "PlaceFields.near": ball("near=red"),
    "PlaceFields.left_of": ball("left_of=red"),
    "PlaceFields.right_of": ball("right_of=red"),
    "PlaceFields.in_front_of": ball("in_front_of=red"),
    "PlaceFields.behind": ball("behind=red"),
    "PlaceFields.facing": ball("facing=red", "on: table, x: 0.1, y: 0.1"),
    "PlaceFields.aligned": ball("aligned=red", "on: table, x: 0.1, y: 0.1", "world.layout.red.yaw=0.5"),
    "PlaceFields.rest": ball("rest=stable", "on: table", "world.objects.ball.source={box: [0.1, 0.02, 0.05]}"),
    "PlaceFields.roll": ball("roll=0.3", "on: table, x: 0.1, y: 0.1"),
    "PlaceFields.pitch": ball("pitch=0.3", "on: table, x: 0.1, y: 0.1"),
    "PlaceFields.yaw": ball("yaw=0.3", "on: table, x: 0.1, y: 0.1"),
    "PlaceFields.arrange": ball("arrange=pack"),
    "PlaceFields.overhang": ball("overhang=0.02"),
    "PlaceFields.clearance": ball("clearance=0.4"),
    "PlaceFields.clear_of": ball("clear_of={red: 0.4}"),
    "PlaceFields.checked": row(
        "world.layout.ball.checked=true",
        error="no place",
        given=("world.layout.ball=null", "world.layout.ball={position: [0, 0, 0.3], checked: false}"),
    ),
    "RegionSpec.rectangle": ball(
        "region.rectangle=[[0, 0], [0.1, 0.3]]", "on: table, region: {rectangle: [[0, 0], [0.1, 0.1]]}"
    ),
    "RegionSpec.circle": ball("region.circle={radius: 0.2}", "on: table, region: {circle: {radius: 0.1}}"),
    "RegionSpec.polygon": ball(
        "region.polygon=[[0, 0], [0.3, 0], [0, 0.1]]", "on: table, region: {polygon: [[0, 0], [0.1, 0], [0, 0.1]]}"
    ),
    "RegionSpec.of": ball("region.of=red", "region: {circle: {radius: 0.1}}, checked: false"),
    "CircleSpec.center": ball("region.circle.center=[0.2, 0.1]", "on: table, region: {circle: {radius: 0.1}}"),
    "CircleSpec.radius": ball("region.circle.radius=0.2", "on: table, region: {circle: {radius: 0.1}}"),
    "Relation.of": ball("near.of=cone", "on: table, near: {of: red}", *CONE),
    "Apart.distance": ball("near.distance=[0.3, 0.31]", "on: table, near: {of: red}", "world.layout.red.x=0"),
    "SideSpec.axes": ball("left_of.axes=own", "on: table, left_of: {of: red}"),
    "SideSpec.lateral": ball("left_of.lateral=0.2", "on: table, left_of: {of: red}"),
    "FacingSpec.of": ball("facing.of=table", "on: table, x: 0.1, y: 0.1, facing: {of: red}"),
    "FacingSpec.point": ball("facing.point=[1, 0]", "on: table, x: 0.1, y: 0.1, facing: {point: [0, 1]}"),
    "AlignedSpec.along": ball("aligned.along=x", "on: table, aligned: {of: red}"),
    "AlignedSpec.offset": ball("aligned.offset=0.1", "on: table, aligned: {of: red, along: x}"),
    "PlacementSpec.any_of": ball("any_of=[{x: 0.1}, {x: -0.1}]"),
    "PlacementSpec.ratio": ball("ratio=0.4", "on: table, x: {range: [-0.4, 0.4]}"),
    "PlacementSpec.otherwise": ball("otherwise={on: terrain, x: 1, y: 1}", "on: table, ratio: 0.4"),
    "Alternative.weight": ball(
        "any_of=[{x: 0.1, weight: 0.001}, {x: -0.1}]", "on: table, any_of: [{x: 0.1}, {x: -0.1}]"
    ),
    "LayoutSourceSpec.proposal": row("world.layout_source.proposal=$FILES/other_plan.json", given=PLAN),
    "LayoutSourceSpec.repair": row(
        "world.layout_source.repair={drop: 0.0}", given=PLAN, error="than the 0 m that it may"
    ),
    "LayoutSourceSpec.on_refusal": row("world.layout_source.on_refusal=error", given=BAD, error="refused"),
    "RepairSpec.distance": row("world.layout_source.repair.distance=0.0", given=PLAN, error="refused"),
    "RepairSpec.drop": row("world.layout_source.repair.drop=0.0", given=PLAN, error="than the 0 m that it may"),
    "RepairSpec.angle": row("world.layout_source.repair.angle=0.0", given=PLAN),
}
