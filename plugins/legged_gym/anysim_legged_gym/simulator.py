"""The simulator: one object that steps, resets, pushes and reads many copies of a legged robot on any engine."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from anysim.api import simulation
from anysim.conventions import Array
from anysim.engine import arguments
from anysim.errors import TaskError
from anysim.model.world import World
from anysim.randomization.streams import Streams
from anysim_legged_gym.build import legged_world
from anysim_legged_gym.control import Drives
from anysim_legged_gym.depth import DepthCamera
from anysim_legged_gym.drawing import Viewer
from anysim_legged_gym.ground import Ground
from anysim_legged_gym.layout import Layout, named_links
from anysim_legged_gym.moment import Moment
from anysim_legged_gym.randomization import DomainRandomization
from anysim_legged_gym.readings import LastValues, Readings
from anysim_legged_gym.selection import chosen_engine, load_spec
from anysim_legged_gym.spec import LeggedSpec


class LeggedSimulator(Readings):
    """N robots of one kind on one engine. Everything that is read is of now, also right after a reset.

    Attributes:
        engine: the engine, for what is not here.
        cfg: the spec, as it is in force.
    """

    def __init__(
        self,
        cfg: str | Path | Mapping[str, Any] | LeggedSpec | None = None,
        simulator: str | None = None,
        *,
        num_envs: int | None = None,
        overrides: Sequence[str] = (),
    ) -> None:
        """Build the robots and reset them all.

        Args:
            cfg: a YAML file, a mapping, or a spec; all defaults if not given.
            simulator: an installed engine; wins over `cfg`, which wins over the environment variable SIMULATOR.
            num_envs: wins over `cfg`.
            overrides: dotted ones, as `control.action_scale=0.3`.

        Raises:
            SpecError: the configuration, with file, line and column.
            PluginError: no such engine or robot.
            CapabilityError: the engine cannot run it, as a mesh for a ground; nothing was built.
            TaskError: a name that is none of the robot's, or a robot without legs.
        """
        more = [*overrides, *([] if num_envs is None else [f"num_envs={num_envs}"])]
        spec = load_spec({} if cfg is None else cfg, more)
        chosen = chosen_engine(spec, simulator)
        made = legged_world(spec, chosen)
        self.cfg = spec.model_copy(update={"simulator": chosen})
        self.streams = Streams(spec.num_envs, spec.seed)
        self.streams.begin(np.arange(spec.num_envs))
        self.engine = simulation(made.run)
        try:
            self.engine.create_world(made.world, spec.num_envs)
            self._make(made.measured)
        except BaseException:
            self.engine.destroy()
            raise

    def _make(self, measured: World) -> None:
        spec, engine = self.cfg, self.engine
        self.layout = Layout.of(engine.world, spec.asset)
        self.ground = Ground(measured, spec.terrain, self.streams)
        self._every = np.arange(engine.num_envs)
        self._set_initial_state()
        latest = 0 if spec.domain_rand.ctrl_delay is None else spec.domain_rand.ctrl_delay[1]
        self._drives = Drives(engine, self.layout, spec.control, self.default_dof_pos, latest)
        self._random = DomainRandomization(engine, self.layout, spec.domain_rand, spec.control, self.streams)
        pushed = spec.domain_rand.push_links
        links = named_links(self.layout.body_names, pushed, "domain_rand.push_links") if pushed else np.array([0])
        self._pushed = [self.layout.bodies.start + int(i) for i in links]
        self._push_left, self._push = 0, np.zeros((engine.num_envs, len(self._pushed), 6))
        self._pushes = 0
        self._depth = None if spec.depth is None else DepthCamera(engine, self.layout, spec.depth)
        self._viewer = Viewer(engine, self.ground, spec.viewer)
        self._gravity = np.array(spec.sim.gravity)
        self._moment: Moment | None = None
        self._last = LastValues.zeros(engine.num_envs, len(self.layout.dof_names), len(self.layout.feet))
        self.reset_idx(self._every)

    def _set_initial_state(self) -> None:
        """The pose over an env's origin, and the joints, after a reset."""
        spec, layout, world = self.cfg.init_state, self.layout, self.engine.world
        home = world.initial_body_pose[layout.root].copy()
        if spec.position is not None:
            home[:3] = spec.position
        turn = np.array(spec.rotation)
        if abs(np.linalg.norm(turn) - 1.0) > 1e-6:
            raise TaskError(f"init_state.rotation is a unit quaternion xyzw, got {list(spec.rotation)}")
        home[3:] = turn
        self.base_init_pos, self.base_init_quat = home[:3], home[3:]
        self.default_dof_pos = np.array([world.joints[j].initial for j in layout.joints])
        """(D,) [rad] joint positions after a reset, which an action of zero holds."""

    @property
    def moment(self) -> Moment:
        """All quantities of now."""
        state = self.engine.get_state()
        if self._moment is None or self._moment.state is not state:
            self._moment = Moment(state, self.layout, self.ground, self._gravity)
        return self._moment

    # ------------------------------------------------------------------ stepping

    def step(self, actions: ArrayLike) -> None:
        """Take actions (N, D), typically in [-1, 1], and go on by `control.decimation` physics steps.

        Raises:
            TaskError: they have another shape, or are not finite.
        """
        before = self._last_values()
        self._drives.command(actions)
        self._last = before
        if self._push_left:
            self.engine.apply_wrench(self._push, self._pushed)
            self._push_left -= 1
        self.engine.step(self.cfg.control.decimation)

    def _last_values(self) -> LastValues:
        now = self.moment
        return LastValues(
            self._drives.actions,
            now.dof_pos,
            now.dof_vel,
            now.torques,
            now.in_base[:, 0],
            now.in_base[:, 1],
            now.feet[1],
        )

    def post_physics_step(self) -> None:
        """Read at once what is otherwise read when it is first asked for: the engine's state, and the heights."""
        moment = self.moment
        for name in ("base_quat", "in_base", "dof_pos", "dof_vel", "torques", "feet", "link_contact_forces"):
            getattr(moment, name)
        _ = moment.measured_heights

    def update_sensors(self) -> None:
        """Look with the depth camera, if there is one."""
        if self._depth is not None:
            self._depth.update(self._every)

    # ------------------------------------------------------------------ resets

    def reset_idx(self, env_ids: ArrayLike) -> None:
        """Put envs into their initial state on their ground, with new gains and delays, and no past."""
        ids = self._ids(env_ids)
        if not len(ids):
            return
        self.streams.begin(ids)
        self.engine.reset(ids)
        poses = np.empty((len(ids), 1, 7))
        poses[:, 0, :3] = self.ground.env_origins[ids] + self.base_init_pos
        poses[:, 0, 3:] = self.base_init_quat
        twist = np.broadcast_to([*self.cfg.init_state.lin_vel, *self.cfg.init_state.ang_vel], (len(ids), 1, 6))
        self.engine.set_body_state(poses, twist, ids, [self.layout.root])
        self._random.redraw(ids)
        self._drives.reset(ids)
        self._drives.delay[ids] = self._random.delays(ids)
        self._push[ids] = 0.0
        self._past_is_gone(ids)

    def reset_dofs(self, env_ids: ArrayLike, dof_pos: ArrayLike, dof_vel: ArrayLike) -> None:
        """Write joint positions and velocities (E, D) [rad, rad/s]."""
        ids = self._ids(env_ids)
        if len(ids):
            joints = self.layout.joints
            self.engine.set_joint_state(np.asarray(dof_pos), np.asarray(dof_vel), ids, joints)
            self._past_is_gone(ids)

    def reset_root_states(
        self,
        env_ids: ArrayLike,
        base_pos: ArrayLike,
        base_quat: ArrayLike,
        base_lin_vel_w: ArrayLike,
        base_ang_vel_w: ArrayLike,
    ) -> None:
        """Write poses (E, 3), (E, 4) xyzw and velocities (E, 3), (E, 3) of bases, world frame."""
        ids = self._ids(env_ids)
        if len(ids):
            pose = np.concatenate([np.asarray(base_pos), np.asarray(base_quat)], axis=-1)[:, None]
            twist = np.concatenate([np.asarray(base_lin_vel_w), np.asarray(base_ang_vel_w)], axis=-1)[:, None]
            self.engine.set_body_state(pose, twist, ids, [self.layout.root])
            self._past_is_gone(ids)

    def _past_is_gone(self, ids: Array) -> None:
        self._last = self._last.without(ids)
        if self._depth is not None:
            self._depth.forget(ids)

    def _ids(self, env_ids: ArrayLike) -> Array:
        return arguments.indices(np.asarray(env_ids), self.engine.num_envs, "env")

    def update_terrain_curriculum(self, env_ids: ArrayLike, move_up: ArrayLike, move_down: ArrayLike) -> None:
        """Raise or lower the level of envs by one, from their next reset on; beyond the last level any is drawn.

        Raises:
            TaskError: the ground has no levels, or not one boolean (E,) for each env.
        """
        self.ground.move(self._ids(env_ids), np.asarray(move_up), np.asarray(move_down))

    # ------------------------------------------------------------------ pushes

    def push_robots(self) -> None:
        """Change the velocity of each base along x and y, by up to `domain_rand.max_push_vel_xy` [m/s]."""
        twist = self.engine.get_state().body_twist[:, [self.layout.root]].copy()
        most = self.cfg.domain_rand.max_push_vel_xy
        twist[:, 0, :2] += self._push_draws("push_robots", most, 2)
        self.engine.set_body_state(twist=twist, bodies=[self.layout.root])

    def push_links(self) -> None:
        """Push links with up to `domain_rand.max_push_force` [N] along each axis, for `push_steps` actions."""
        most, count = self.cfg.domain_rand.max_push_force, len(self._pushed)
        self._push[..., :3] = self._push_draws("push_links", most, 3 * count).reshape(-1, count, 3)
        self._push_left = self.cfg.domain_rand.push_steps

    def _push_draws(self, name: str, most: float, count: int) -> Array:
        self._pushes += 1
        draws = [
            self.streams.shared_generator(env, f"legged/{name}", self._pushes).uniform(-most, most, count)
            for env in range(self.num_envs)
        ]
        return np.array(draws)

    # ------------------------------------------------------------------ pictures

    def set_viewer_camera(self, eye: ArrayLike, target: ArrayLike) -> None:
        """Put the viewer's camera at `eye`, towards `target`, both (3,) [m], world frame."""
        self._viewer.look(eye, target)

    def draw_debug_vis(self) -> None:
        """Draw the viewed env and what the flags of `viewer` ask for into `viewer_image`; nothing without a flag."""
        if self._viewer.marks:
            self.draw_viewer()

    def draw_viewer(self) -> Array:
        """A picture (H, W, 3) of the viewed env, with what the flags of `viewer` ask for."""
        depth = None if self._depth is None else self._depth.images[self.cfg.viewer.env]
        return self._viewer.draw(self.moment, depth)

    # ------------------------------------------------------------------ the end

    def close(self) -> None:
        """Free the engine's world. May be called any number of times."""
        self.engine.destroy()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
