"""Changes of the keys of `world` but for the layout's: ground, room, robots, objects, cameras, lights, contacts."""

from tests.schemas.keys.row import OBSERVED, Row, row

SMALL = (
    *(f"world.{kind}.{name}=null" for name in ("table", "red", "ball") for kind in ("objects", "layout")),
    "world.cameras.eye=null",
    "task=null",
)
"""Without what stands in the way of walls and tiles."""


def ground(change: str, **keys: object) -> Row:
    """A change of `world.terrain` of a kind of ground."""
    text = ", ".join(f"{key}: {value}" for key, value in keys.items())
    return row(f"world.terrain.{change}", given=(*SMALL, f"world.terrain={{{text}}}"))


def relief(kind: str, change: str) -> Row:
    """A change of generated ground."""
    return ground(change, kind=kind, size="[4, 4]", cell=0.2)


def tiles(change: str, tiles: str = "") -> Row:
    """A change of tiled ground. Its scene is where its level is: episodes show what the World does not."""
    text = f"columns: [rough, {{kind: slopes, slope: 0.3}}], size: 4, rows: 3{tiles}"
    ball = "world.objects.ball={source: {sphere: 0.03}}", "world.layout.ball={position: [0, 0, 0.03]}"
    given = *SMALL, *ball, "task={observations: {policy: [{term: frame_pose, frame: ball}]}}"
    return row(
        f"world.terrain.tiles.{change}", given=(*given, f"world.terrain={{kind: tiles, cell: 0.2, tiles: {{{text}}}}}")
    )


def room(change: str, keys: str = "") -> Row:
    """A change of a room."""
    return row(f"world.room.{change}", given=(*SMALL, f"world.room={{seed: 3{keys}}}"))


def red(change: str, *given: str) -> Row:
    """A change of a box of the blocks."""
    return row(f"world.objects.red.{change}", given=given)


def eye(change: str, *given: str) -> Row:
    """A change of the camera."""
    return row(f"world.cameras.eye.{change}", given=given)


ARM = "world.robots.arm={robot: $FILES/two_link.yaml, position: [0, 0, 1], actions: {arm: joint_delta_position}}"
SEE_ARM = "task.observations={policy: [joint_pos, joint_vel, last_action]}"


def arm(change: str, *given: str) -> Row:
    """A change of a robot."""
    return row(f"world.robots.arm.{change}", given=(ARM, SEE_ARM, *given))


VALVE = "world.objects.red.source={procedural: valve}"
ALONE = "world.cameras.eye=null", "task=null"
HINGE = "world.objects.red.source={procedural: hinge_box}"
MANY = *ALONE, "world.objects.red.count=8", "world.objects.red.family=rigid_instancer"
MESH = "world.objects.red.source={mesh: 'file:$FILES/shapes/a.obj'}"
FOLDER = "world.objects.red.source={folder: 'file:$FILES/shapes', pattern: '*'}"
PIECES = "collision: {method: decompose, concavity: 0.05"
PACKED = "source={asset: 'file:$FILES/packed.urdf', packages: {toys: 'file:$FILES"
PATTERN = "world.objects.red.texture={pattern: noise}"
MOUNT = "world.cameras.eye={mount: red, channels: []}"
DOORS, WINDOWS = ", doors: [{wall: east}]", ", windows: [{wall: north}]"

SCENE = "world.source=file:$FILES/scene.xml"
PACKED_SDF = "world.source={file: 'file:$FILES/packed.sdf', packages: {toys: 'file:$FILES"

ROWS: dict[str, Row] = {
    "WorldSpec.name": row("world.name=other"),
    "WorldSpec.terrain": row("world.terrain=none"),
    "WorldSpec.room": row("world.room={size: [6, 6]}"),
    "WorldSpec.robots": row(ARM),
    "WorldSpec.objects": row("world.objects.more={source: {sphere: 0.1}}", "world.layout.more={position: [2, 2, 1]}"),
    "WorldSpec.layout": row("world.layout.ball={position: [0, 0, 2]}"),
    "WorldSpec.regions": row(
        "world.regions.spot={circle: {radius: 0.3}}",
        given=(
            "world.regions.spot={circle: {radius: 0.1}}",
            "world.layout.ball=null",
            "world.layout.ball={on: table, region: spot}",
        ),
    ),
    "WorldSpec.layout_source": row("world.layout_source=$FILES/plan.json"),
    "WorldSpec.cameras": row("world.cameras.eye=null"),
    "WorldSpec.lights": row("world.lights.lamp={intensity: 0.5}"),
    "WorldSpec.scenery": row("world.scenery={ambient: [0.1, 0.2, 0.3]}"),
    "WorldSpec.contact_sensors": row("world.contact_sensors.touch={body: red}"),
    "WorldSpec.visual_error": row("world.visual_error=0.02", given="world.robots.panda={robot: franka_panda}"),
    "WorldSpec.collisions": row("world.collisions={exclude: [[red, ball]]}"),
    "ReliefSpec.amplitude": relief("rough", "amplitude=0.5"),
    "ReliefSpec.grain": relief("rough", "grain=0.9"),
    "ReliefSpec.wavelength": relief("waves", "wavelength=1.1"),
    "ReliefSpec.slope": relief("slopes", "slope=0.9"),
    "ReliefSpec.rise": relief("stairs", "rise=0.5"),
    "ReliefSpec.tread": relief("stairs", "tread=0.6"),
    "ReliefSpec.down": relief("stairs", "down=true"),
    "ReliefSpec.stone": ground("stone=0.5", kind="stepping_stones", size="[4, 4]", cell=0.1),
    "ReliefSpec.gap": relief("gaps", "gap=0.8"),
    "ReliefSpec.depth": relief("gaps", "depth=0.3"),
    "ReliefSpec.block": relief("obstacles", "block=[0.8, 0.9]"),
    "ReliefSpec.density": relief("obstacles", "density=1.5"),
    "ReliefSpec.platform": relief("rough", "platform=1.0"),
    "TerrainSpec.kind": row("world.terrain.kind=none"),
    "TerrainSpec.friction": row("world.terrain.friction=0.3"),
    "TerrainSpec.margin": row("world.terrain.margin=0.01"),
    "TerrainSpec.restitution": row("world.terrain.restitution=0.3"),
    "TerrainSpec.color": row("world.terrain.color=red"),
    "TerrainSpec.heights": ground("heights=[[0, 1], [0, 0]]", kind="heightfield", heights="[[0, 0], [0, 1]]"),
    "TerrainSpec.file": ground("file=$FILES/b.npy", kind="heightfield", file="$FILES/a.npy"),
    "TerrainSpec.height_range": ground(
        "height_range=[0, 2]", kind="heightfield", file="$FILES/grey.bmp", height_range="[0, 1]"
    ),
    "TerrainSpec.scale": ground("scale=2.0", kind="trimesh", file="$FILES/shapes/a.obj"),
    "TerrainSpec.size": ground("size=[5, 4]", kind="rough", size="[4, 4]", cell=0.2),
    "TerrainSpec.cell": relief("rough", "cell=0.1"),
    "TerrainSpec.difficulty": relief("rough", "difficulty=0.9"),
    "TerrainSpec.seed": relief("rough", "seed=1"),
    "TerrainSpec.tiles": tiles("rows=2"),
    "TilesSpec.columns": tiles("columns=[waves]"),
    "TilesSpec.rows": tiles("rows=2"),
    "TilesSpec.difficulty": tiles("difficulty=[0.2, 0.6]"),
    "TilesSpec.size": tiles("size=5.0"),
    "TilesSpec.border": tiles("border=1.0"),
    "TilesSpec.choose": tiles("choose=curriculum"),
    "TilesSpec.start": tiles("start=0", ", choose: curriculum"),
    "TileColumnSpec.kind": tiles("columns=[waves, {kind: slopes, slope: 0.3}]"),
    "TileColumnSpec.weight": tiles("columns=[{kind: rough, weight: 0.05}, {kind: slopes, slope: 0.3}]"),
    "RoomSpec.size": room("size=[6, 5]"),
    "RoomSpec.plan": room("plan=[[0, 0], [5, 0], [5, 4]]", ", doors: []"),
    "RoomSpec.height": room("height=3.0"),
    "RoomSpec.thickness": room("thickness=0.2"),
    "RoomSpec.ceiling": room("ceiling=true"),
    "RoomSpec.doors": room("doors=[]"),
    "RoomSpec.windows": room("windows=[{wall: west}]"),
    "RoomSpec.style": room("style=office"),
    "RoomSpec.furniture": room("furniture={table: 1}"),
    "RoomSpec.walkway": room("walkway=1.2", ", style: kitchen, doors: [{wall: south}, {wall: north}]"),
    "RoomSpec.seed": room("seed=4", ", style: office"),
    "RoomSpec.friction": room("friction=0.2"),
    "RoomSpec.floor_color": room("floor_color=red"),
    "RoomSpec.wall_color": room("wall_color=red"),
    "RoomSpec.furniture_color": room("furniture_color=red", ", style: office"),
    "OpeningSpec.wall": room("doors=[{wall: west}]", DOORS),
    "OpeningSpec.at": room("doors=[{wall: east, at: 0.3}]", DOORS),
    "DoorSpec.width": room("doors=[{wall: east, width: 1.1}]", DOORS),
    "DoorSpec.height": room("doors=[{wall: east, height: 2.2}]", DOORS),
    "WindowSpec.width": room("windows=[{wall: north, width: 1.5}]", WINDOWS),
    "WindowSpec.height": room("windows=[{wall: north, height: 1.0}]", WINDOWS),
    "WindowSpec.sill": room("windows=[{wall: north, sill: 1.0}]", WINDOWS),
    "RobotSpec.robot": arm("robot=franka_panda"),
    "RobotSpec.position": arm("position=[1, 0, 1]"),
    "RobotSpec.yaw": arm("yaw=0.5"),
    "RobotSpec.home": arm("home={elbow: 0.4}"),
    "RobotSpec.home_velocity": arm("home_velocity={elbow: 0.4}"),
    "RobotSpec.home_noise": arm("home_noise=0.1"),
    "RobotSpec.actions": arm("actions.arm=null"),
    "RobotSpec.dynamics": arm("dynamics={mass_scale: 2.0}"),
    "RobotSpec.self_collision": arm("self_collision=true", "world.robots.arm.self_collision=false"),
    "ActionSpec.controller": arm("actions.arm=joint_position"),
    "ActionSpec.params": arm("actions.arm={controller: joint_delta_position, params: {scale: 0.5}}"),
    "ActionSpec.noise": arm("actions.arm={controller: joint_delta_position, noise: {normal: {mean: 0, std: 0.1}}}"),
    "ActionSpec.delay": arm("actions.arm={controller: joint_delta_position, delay: 1}"),
    **{
        f"RobotDynamicsSpec.{key}": arm(f"dynamics.{key}={value}")
        for key, value in {
            "kp_scale": 2.0,
            "kd_scale": 2.0,
            "effort_limit_scale": 0.5,
            "damping_offset": 0.1,
            "friction_offset": 0.1,
            "armature_scale": 2.0,
            "armature_offset": 0.1,
            "mass_scale": 2.0,
            "link_friction_scale": 0.5,
            "payload": "{link: paddle, mass: 0.5}",
        }.items()
    },
    "RobotDynamicsSpec.damping_scale": arm("dynamics.damping_scale=2.0", "world.robots.arm.robot=franka_panda"),
    "RobotDynamicsSpec.friction_scale": arm("dynamics.friction_scale=2.0", "world.robots.arm.robot=xarm7"),
    "RobotDynamicsSpec.independent": arm(
        "dynamics.independent=true", "world.robots.arm.dynamics={kp_scale: {range: [0.5, 2.0]}}"
    ),
    **{
        f"PayloadSpec.{change.partition('=')[0]}": arm(
            f"dynamics.payload.{change}", "world.robots.arm.dynamics={payload: {link: paddle, mass: 0.5}}"
        )
        for change in ("link=upper", "mass=0.7", "position=[0.1, 0, 0.2]")
    },
    "ObjectSpec.source": red("source={sphere: 0.04}"),
    "ObjectSpec.scale": red("scale=1.2"),
    "ObjectSpec.sizes": red("sizes=3", "world.objects.red.scale={range: [0.8, 1.2]}"),
    "ObjectSpec.count": red("count=2", *ALONE),
    "ObjectSpec.family": red("family=rigid_instancer", *ALONE, "world.objects.red.count=8"),
    "ObjectSpec.grid": red("grid=[4, 1]", *MANY),
    "ObjectSpec.gap": red("gap=0.02", *MANY),
    "ObjectSpec.fixed": red("fixed=true"),
    "ObjectSpec.mass": red("mass=2.0"),
    "ObjectSpec.density": red("density=700.0", "world.objects.red.mass=null"),
    "ObjectSpec.com_offset": red("com_offset=[0.01, 0, 0]"),
    "ObjectSpec.inertia_scale": red("inertia_scale=1.5"),
    "ObjectSpec.friction": red("friction=0.1"),
    "ObjectSpec.restitution": red("restitution=0.5"),
    "ObjectSpec.damping": red("damping={linear: 0.2}"),
    "ObjectSpec.contact": red("contact={preset: pad}"),
    "ObjectSpec.joints": red("joints={'*': {damping: 0.7}}", VALVE),
    "ObjectSpec.solver": red("solver={position_iterations: 20}"),
    "ObjectSpec.color": red("color=white"),
    "ObjectSpec.texture": red("texture=checker"),
    "ObjectSpec.material": red("material=metal"),
    "ObjectSpec.label": red("label=brick"),
    "ObjectSpec.collides": red("collides=false"),
    "SourceSpec.box": red("source={box: [0.06, 0.05, 0.05]}"),
    "SourceSpec.sphere": red("source={sphere: 0.04}", "world.objects.red.source={sphere: 0.03}"),
    "SourceSpec.cylinder": red("source={cylinder: [0.03, 0.06]}", "world.objects.red.source={cylinder: [0.03, 0.05]}"),
    "SourceSpec.capsule": red("source={capsule: [0.03, 0.06]}", "world.objects.red.source={capsule: [0.03, 0.05]}"),
    "SourceSpec.mesh": red("source={mesh: 'file:$FILES/shapes/b.obj'}", MESH),
    "SourceSpec.asset": red("source={asset: 'file:$FILES/two_link.urdf'}"),
    "WorldSpec.source": row("world.source=file:$FILES/scene.xml"),
    "SceneSpec.file": row("world.source.file=file:$FILES/packed.sdf", error="no package 'toys'", given=SCENE),
    "SceneSpec.packages": row(f"{PACKED_SDF}/others'}}}}", given=f"{PACKED_SDF}/shapes'}}}}"),
    "SceneSpec.notes": row("world.source.notes=[]", given=SCENE),
    "SourceSpec.packages": red(f"{PACKED}/others'}}}}", f"world.objects.red.{PACKED}/shapes'}}}}"),
    "SourceSpec.procedural": red("source={procedural: hinge_box}", VALVE),
    "SourceSpec.params": red("source={procedural: valve, params: {damping: 0.7}}", VALVE),
    "SourceSpec.scale": red("source={mesh: 'file:$FILES/shapes/a.obj', scale: 0.5}", MESH),
    "SourceSpec.collision": red("source.collision={method: primitives}", MESH),
    "SourceFolder.collision": red("source.collision={method: primitives}", FOLDER),
    "CollisionShapesSpec.method": red("source.collision.method=primitives", f"{MESH[:-1]}, collision: hull}}"),
    "CollisionShapesSpec.concavity": red("source.collision.concavity=0.5", f"{MESH[:-1]}, {PIECES}}}}}"),
    "CollisionShapesSpec.pieces": red("source.collision.pieces=2", f"{MESH[:-1]}, {PIECES}}}}}"),
    "SourceFolder.folder": red("source={folder: 'file:$FILES/others', pattern: '*'}", FOLDER),
    "SourceFolder.pattern": red("source={folder: 'file:$FILES/shapes', pattern: 'a*'}", FOLDER),
    "SourceFolder.scale": red("source={folder: 'file:$FILES/shapes', pattern: '*', scale: 0.5}", FOLDER),
    "SourceFolder.shared": red("source={folder: 'file:$FILES/shapes', pattern: '*', shared: toys}", FOLDER),
    "DampingSpec.linear": red("damping={linear: 0.2}"),
    "DampingSpec.angular": red("damping={angular: 0.2}"),
    **{
        f"ContactSpec.{change.partition('=')[0]}": red(f"contact.{change}", "world.objects.red.contact={}")
        for change in ("preset=soft", "torsional_friction=0.01", "rolling_friction=0.01", "priority=2", "offset=0.01")
    },
    **{
        f"ObjectJointSpec.{change.partition('=')[0]}": red(f"joints={{'*': {{{change.replace('=', ': ')}}}}}", HINGE)
        for change in ("initial=0.3", "opened=0.5", "friction=0.4", "damping=0.7", "limits=[0.0, 0.4]")
    },
    **{
        f"SolverSpec.{change.partition('=')[0]}": red(f"solver.{change}", "world.objects.red.solver={}")
        for change in (
            "position_iterations=20",
            "velocity_iterations=4",
            "sleep_threshold=0.1",
            "depenetration_speed=2.0",
        )
    },
    "TextureSpec.pattern": red("texture.pattern=checker", PATTERN),
    "TextureSpec.image": red("texture={image: 'file:$FILES/grey.bmp'}"),
    "TextureSpec.colors": red("texture.colors=[red, blue]", PATTERN),
    "TextureSpec.repeat": red("texture.repeat=3", PATTERN),
    "TextureSpec.seed": red("texture.seed=3", PATTERN),
    "TextureSpec.resolution": red("texture.resolution=64", PATTERN),
    "MaterialSpec.preset": red("material={preset: glass}"),
    **{
        f"MaterialSpec.{key}": red(f"material={{{key}: 0.35}}", "world.objects.red.material={}")
        for key in ("roughness", "metallic", "specular", "emission", "opacity")
    },
    "CameraSpec.from_": eye("from=[1, 1, 2]"),
    "CameraSpec.look_at": eye("look_at=ball"),
    "CameraSpec.look_at_offset": eye("look_at_offset=[0, 0, 0.1]"),
    "CameraSpec.mount": eye("mount=ball", MOUNT),
    "CameraSpec.position": eye("position=[0, 0, 0.1]", MOUNT),
    "CameraSpec.roll_pitch_yaw": eye("roll_pitch_yaw=[0, 0.1, 0]", MOUNT),
    "CameraSpec.fov": eye("fov=40.0"),
    "CameraSpec.size": eye("size=[64, 48]"),
    "CameraSpec.channels": eye("channels=[depth]"),
    "CameraSpec.exposure": row("world.cameras.eye.exposure=1.5", given=OBSERVED, seen="filmed"),
    "CameraSpec.noise": row("world.cameras.eye.noise=0.1", given=OBSERVED, seen="filmed"),
    "CameraSpec.near": eye("near=0.02"),
    "CameraSpec.far": eye("far=15.0"),
    "LightSpec.direction": row("world.lights.lamp={direction: [1, 0, -1]}", given="world.lights.lamp={}"),
    "LightSpec.position": row("world.lights.lamp={position: [1, 0, 2]}", given="world.lights.lamp={}"),
    "LightSpec.color": row("world.lights.lamp={color: red}", given="world.lights.lamp={}"),
    "LightSpec.intensity": row("world.lights.lamp={intensity: 0.3}", given="world.lights.lamp={}"),
    "ScenerySpec.background": row("world.scenery.background=red"),
    "ScenerySpec.ambient": row("world.scenery.ambient=[0.1, 0.2, 0.3]"),
    "ScenerySpec.shadows": row("world.scenery.shadows=true"),
    "WorldSpec.families": row("world.families={ann: {kind: avatar}}"),
    "FamilySpec.kind": row(
        "world.families.ann.kind=rigid", given="world.families={ann: {kind: avatar}}", error="what an object is"
    ),
    "ContactSensorSpec.body": row(
        "world.contact_sensors.touch={body: ball}", given="world.contact_sensors.touch={body: red}"
    ),
    "ContactSensorSpec.against": row(
        "world.contact_sensors.touch={body: red, against: table}", given="world.contact_sensors.touch={body: red}"
    ),
    "CollisionsSpec.groups": row(
        "world.collisions.groups={toys: [red]}",
        given="world.collisions={groups: {toys: [ball]}, exclude: [[toys, table]]}",
    ),
    "CollisionsSpec.exclude": row("world.collisions={exclude: [[red, ball]]}"),
}
