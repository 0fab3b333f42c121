"""The simulations of all envs, and all that is kept beside them: what a build makes."""

from mujoco.batch import Batch

from anysim.engine.lighting import Looks
from anysim.model.world import World
from anysim_mujoco.build import build, initial_row
from anysim_mujoco.dampers import Dampers
from anysim_mujoco.drives import Drives
from anysim_mujoco.geoms import own_scenery
from anysim_mujoco.options import MujocoOptions
from anysim_mujoco.parameters import Parameters
from anysim_mujoco.query import Queries
from anysim_mujoco.retired import Retired
from anysim_mujoco.state import StateReader


class Simulations:
    """A batch of them, of one model, and views of its arrays."""

    def __init__(self, world: World, num_envs: int, varies: bool, options: MujocoOptions) -> None:
        """`varies` says that something may be absent."""
        self.model, self.layout = build(world, options)
        self.batch = Batch(self.model, num_envs, nthread=options.thread_count(num_envs))
        self.rows = self.batch.state
        self.initial = initial_row(world, self.model, self.layout)
        self.qpos, self.qvel = self.batch.bind("qpos"), self.batch.bind("qvel")
        self.mocap_pos, self.mocap_quat = self.batch.bind("mocap_pos"), self.batch.bind("mocap_quat")
        self.wrenches = self.batch.bind("xfrc_applied")
        self.drives = Drives(self.batch, world, self.layout)
        self.dampers = Dampers(self.batch, world, self.layout)
        self.looks = Looks(world, num_envs, own_scenery(options))
        self.parameters = Parameters(self.batch, world, self.layout, self.drives, self.dampers, self.looks)
        self.reader = StateReader(self.batch, self.layout)
        self.fields = self.reader.fields
        self.queries = Queries(self.batch, self.layout, self.parameters)
        self.retired = Retired(self.batch, world, self.layout, self.parameters) if varies else None
