"""Changes of the keys beside `world`: engine, physics, task and record."""

from tests.schemas.keys.row import OBSERVED, SEEING, Row, row
from tests.schemas.keys.world import ARM, SEE_ARM

FILMED = *SEEING, "record.cameras=[eye]"
DEPTH = "world.cameras.eye.channels=[rgb, depth]"
EASY = "task.success={there: {term: near, a: red, b: goal, tolerance: 9.0}}"
"""Holds from the first step on."""

SOME = "task.success={there: {term: near, a: red, b: ball, tolerance: 0.5}}"
"""Holds in some envs."""
EXPERT = (
    "task.expert={skill: pick, object: red, goal: goal}",
    "world.robots.panda={robot: franka_panda, position: [0, 0, 0.4]}",
    "world.robots.panda.actions={arm: joint_position, eef: gripper_binary}",
)
COMMANDS = (*EXPERT[1:], "collect={commands: [{do: pick, object: red, goal: goal}]}")
LATE = "collect.commands.0.timeout=0.02"
DRAWN = "collect={bind: {x: {choice: [ball]}}, commands: [{do: pick, object: $x, goal: goal}]}"
RANGED = "collect={bind: {x: {range: [0.1, 0.2]}}, commands: [{do: pick, object: red, goal: goal, hover: $x}]}"
CHOICE = "collect={commands: [{choose: [{do: pick, object: red, goal: goal}, release], weights: [1, 0]}]}"
RELEASE = (*EXPERT[1:], "task.horizon=300", "collect={commands: [release, {do: reach, goal: goal}]}")
REPEATED = "collect={commands: [{repeat: 1, body: release}, {do: reach, goal: goal}]}"
WIDENED = "task.curriculum={spread: {widens: [task.command.goal.height], episodes: 1, step: 0.2}}"
WINNING, LOSING = (WIDENED, EASY), (WIDENED, "task.horizon=2", "task.curriculum.spread.start=0.5")

ROWS: dict[str, Row] = {
    "RunSpec.engine": row("engine=mujoco", seen="engine"),
    "RunSpec.num_envs": row("num_envs=3", seen="engine"),
    "RunSpec.seed": row("seed=1", seen="episode"),
    "RunSpec.level": row("level=fixed", given="levels.fixed.world.objects.red.fixed=true"),
    "RunSpec.levels": row(
        "levels.fixed.world.objects.red.fixed=true", given=("levels.fixed.physics.dt=0.001", "level=fixed")
    ),
    "RunSpec.robot": row("robot=z1", given="alternates.z1.world.robots.arm.robot=z1"),
    "RunSpec.alternates": row(
        "alternates.z1.world.objects.red.fixed=true", given=("alternates.z1.world.robots.arm.robot=z1", "robot=z1")
    ),
    "RunSpec.physics": row("physics={dt: 0.001}"),
    "RunSpec.world": row("world.objects.red.fixed=true"),
    "RunSpec.task": row("task.horizon=2", seen="episode"),
    "RunSpec.record": row("record.keep=all", seen="recorded"),
    "EngineSpec.name": row("engine.name=mujoco", given="engine={name: 'null'}", seen="engine"),
    "EngineSpec.options": row("engine.options={threads: 1}", given="engine=mujoco", seen="engine"),
    "EngineSpec.shards": row("engine={name: 'null', shards: 2}", given="num_envs=2", seen="engine"),
    "EngineSpec.shard_timeout": row(
        "engine.shard_timeout=7", given=("num_envs=2", "engine={name: 'null', shards: 2}"), seen="engine"
    ),
    "PhysicsSpec.dt": row("physics.dt=0.004"),
    "PhysicsSpec.control_dt": row("physics.control_dt=0.04"),
    "PhysicsSpec.gravity": row("physics.gravity=[0, 0, -1.6]"),
    "PhysicsSpec.friction_cone": row("physics.friction_cone=pyramidal"),
    "PhysicsSpec.impratio": row("physics.impratio=10.0"),
    "PhysicsSpec.extent": row("physics.extent=5.0"),
    "PhysicsSpec.actuation": row("physics.actuation=native", given=ARM),
    "PhysicsSpec.velocity_limits": row("physics.velocity_limits=enforce", given=ARM),
    "TaskSpec.description": row("task.description=stack them", given="record.keep=all", seen="recorded"),
    "TaskSpec.shipped": row("task.shipped=package:numpy/none.onnx", seen="shipped"),
    "TaskSpec.horizon": row("task.horizon=2", seen="episode"),
    "TaskSpec.command": row("task.command.goal.height=0.5", seen="episode"),
    "TaskSpec.observations": row("task.observations.policy=[{term: frame_pose, frame: ball}]", seen="episode"),
    "TaskSpec.images": row("task.images={eye: {}}", given=SEEING, seen="filmed"),
    "TaskSpec.rewards": row("task.rewards.close=null", seen="episode"),
    "TaskSpec.success": row(EASY, seen="episode"),
    "TaskSpec.hold": row("task.hold=3", given=EASY, seen="episode"),
    "TaskSpec.failure": row("task.failure={fell: {term: below, frame: red, height: 9.0}}", seen="episode"),
    "TaskSpec.events": row(
        "task.events={polish: {term: set_friction, object: red, friction: {range: [0.1, 0.2]}}}", seen="episode"
    ),
    "TaskSpec.on_success": row("task.on_success=continue", given=EASY, seen="episode"),
    "TaskSpec.ended": row(
        "task.ended=error", given=(SOME, "task.ended=hold"), seen="stepped", error="cannot be stepped"
    ),
    "TaskSpec.curriculum": row(WIDENED, seen="episode"),
    "CurriculumSpec.widens": row("task.curriculum.spread.widens=[layout.ball.x]", given=WIDENED, seen="episode"),
    "CurriculumSpec.around": row("task.curriculum.spread.around=0.1", given=WIDENED, seen="episode"),
    "CurriculumSpec.start": row("task.curriculum.spread.start=0.3", given=WIDENED, seen="episode"),
    "CurriculumSpec.step": row("task.curriculum.spread.step=0.4", given=WINNING, seen="episode"),
    "CurriculumSpec.episodes": row("task.curriculum.spread.episodes=2", given=WINNING, seen="episode"),
    "CurriculumSpec.promote": row("task.curriculum.spread={promote: 0, demote: 0}", given=LOSING, seen="episode"),
    "CurriculumSpec.demote": row("task.curriculum.spread.demote=0", given=LOSING, seen="episode"),
    "TaskSpec.expert": row("task.expert=null", given=EXPERT, seen="expert", error="has no expert"),
    "RunSpec.collect": row("collect=null", given=COMMANDS, seen="expert", error="has no expert"),
    "CollectSpec.commands": row("collect.commands=[{do: reach, goal: goal}]", given=COMMANDS, seen="expert"),
    "CollectSpec.bind": row("collect.bind.x.choice=[red]", given=(*COMMANDS, DRAWN), seen="episode"),
    "BoundRange.range": row("collect.bind.x.range=[0.2, 0.3]", given=(*COMMANDS, RANGED), seen="episode"),
    "BoundRange.steps": row("collect.bind.x.steps=12", given=(*COMMANDS, RANGED), seen="episode"),
    "CollectSpec.on_fail": row("collect.on_fail=skip", given=(*COMMANDS, LATE), seen="expert"),
    "CommandSpec.if_": row(
        "collect.commands.0.if={term: below, frame: red, height: 0.0}", given=COMMANDS, seen="expert"
    ),
    "CommandSpec.success": row(
        "collect.commands.0.success={term: below, frame: red, height: 0.0}", given=RELEASE, seen="expert"
    ),
    "CommandSpec.save": row("collect.commands.0.save=false", given=RELEASE, seen="expert"),
    "ChooseSpec.choose": row("collect.commands.0.choose=[release, release]", given=(*COMMANDS, CHOICE), seen="expert"),
    "ChooseSpec.weights": row("collect.commands.0.weights=[0, 1]", given=(*COMMANDS, CHOICE), seen="expert"),
    "RepeatSpec.repeat": row("collect.commands.0.repeat=2", given=(*RELEASE, REPEATED), seen="expert"),
    "RepeatSpec.body": row("collect.commands.0.body=[]", given=(*RELEASE, REPEATED), seen="expert"),
    "RepeatSpec.until": row(
        "collect.commands.0.until={term: below, frame: red, height: 9.0}", given=(*RELEASE, REPEATED), seen="expert"
    ),
    "CommandSpec.do": row("collect.commands.0.do=bring", given=COMMANDS, seen="expert"),
    "CommandSpec.timeout": row("collect.commands.0.timeout=0.02", given=COMMANDS, seen="expert"),
    "CommandSpec.required": row("collect.commands.0.required=false", given=(*COMMANDS, LATE), seen="expert"),
    "TermSpec.term": row("task.rewards.close.term=tanh_distance", seen="episode"),
    "ObservationTermSpec.noise": row(
        "task.observations.policy=[{term: frame_pose, frame: red, noise: {normal: {mean: 0, std: 0.1}}}]",
        given="task.observations.policy=[{term: frame_pose, frame: red}]",
        seen="episode",
    ),
    "ObservationTermSpec.bias": row(
        "task.observations.policy=[{term: frame_pose, frame: red, bias: 0.1}]",
        given="task.observations.policy=[{term: frame_pose, frame: red}]",
        seen="episode",
    ),
    "ObservationTermSpec.delay": row(
        "task.observations.policy=[{term: joint_pos, delay: 1}]",
        given=(ARM, SEE_ARM, "task.observations.policy=[joint_pos]"),
        seen="episode",
    ),
    "ImageSpec.fps": row("task.images.eye.fps=25", given=(*OBSERVED, ARM), seen="filmed"),
    "ImageSpec.channels": row(
        "task.images.eye.channels=[depth]",
        given=OBSERVED,
        error=r"task\.images\.eye: the camera gives no depth; add depth to world\.cameras\.eye\.channels",
    ),
    "ImageSpec.markers": row("task.images.eye.markers=true", given=OBSERVED, seen="filmed"),
    "RewardTermSpec.weight": row("task.rewards.close.weight=-2.0", seen="episode"),
    "EndingTermSpec.reward": row(
        "task.success.there.reward=2.0", given="task.success.there.tolerance=5", seen="episode"
    ),
    "EventTermSpec.when": row(
        "task.events.polish.when=step",
        given="task.events={polish: {term: set_friction, object: red, friction: {range: [0.1, 0.2]}}}",
        seen="episode",
    ),
    "ExpertSpec.skill": row("task.expert.skill=toss", given=EXPERT, seen="expert", error="no skill named 'toss'"),
    "RecordSpec.writer": row("record.writer=other", seen="recorded", error="no writer named 'other'"),
    "RecordSpec.options": row("record.options={crf: 51}", given=FILMED, seen="filmed"),
    "RecordSpec.cameras": row("record.cameras=[eye]", given=SEEING, seen="filmed"),
    "RecordSpec.channels": row("record.channels={eye: [depth]}", given=(*SEEING, DEPTH), seen="filmed"),
    "RecordSpec.streams": row("record.streams={language: {}}", given="record.keep=all", seen="recorded"),
    "RecordSpec.fps": row("record.fps=10", given=FILMED, seen="filmed"),
    "RecordSpec.markers": row("record.markers=false", given=FILMED, seen="filmed"),
    "RecordSpec.keep": row("record.keep=all", seen="recorded"),
    "RecordSpec.film": row("record.film=live", given=FILMED, seen="filmed"),
}
