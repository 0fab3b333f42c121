"""PyBullet as a SimEngine: a DIRECT client for each env, stepped one after the other."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from anysim.conventions import Array
from anysim.engine.availability import Finding, Health
from anysim.engine.capability import Allowance, Capabilities
from anysim.engine.presence import Lifecycle
from anysim.engine.requirements import crowded
from anysim.engine.snapshots.row_checks import refuse_range
from anysim.engine.state import SnapshotLevel
from anysim.model.world import World
from anysim_mechanics.one_world.base import OneWorldPerEnv
from anysim_pybullet import declared
from anysim_pybullet.options import PybulletOptions

if TYPE_CHECKING:
    from anysim_pybullet.envs import Envs


class PybulletEngine(OneWorldPerEnv):
    """The engine `pybullet`. Trajectories do not depend on the number of envs or their order."""

    name: ClassVar[str] = "pybullet"
    capabilities: ClassVar[Capabilities] = declared.CAPABILITIES
    parameters: ClassVar[frozenset[str]] = declared.PARAMETERS
    lifecycle: ClassVar[Lifecycle] = Lifecycle.P1
    ragged_rows = frozenset({"bullet"})
    audit_allowances: ClassVar[Mapping[str, Allowance]] = declared.AUDIT_ALLOWANCES
    library = declared.LIBRARY
    options_type = PybulletOptions
    options: PybulletOptions
    _envs: "Envs"

    @classmethod
    def findings(cls) -> tuple[Finding, ...]:
        """Threads."""
        words = "one per process, it keeps the interpreter's lock: `shards` uses more"
        return (Finding("pybullet: threads", Health.NOTE, words),)

    @classmethod
    def refusals(cls, world: World, options: Any) -> Sequence[str]:
        """More links than Bullet tells the states of; further shapes of a body are links, too."""
        return crowded(world, declared.LINKS, shapes=True)

    @classmethod
    def refuse_rows(cls, data: Mapping[str, Array], level: SnapshotLevel, world: World, options: object) -> None:
        if level is SnapshotLevel.TRAJECTORY:
            refuse_range("length", data["length"], 1, data["bullet"].shape[1])

    def renderer_name(self) -> str:
        """What draws the images."""
        return "TinyRenderer, in software"

    def _make(self, world: World, present: Array) -> "Envs":
        # imported here, so that the engine can say that it is not available where PyBullet is not installed
        from anysim_pybullet.envs import Envs

        return Envs(world, present, self.options)
