"""SAPIEN as a SimEngine: one scene per env, stepped one after the other on the CPU."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from anysim.conventions import Array
from anysim.engine.availability import Finding
from anysim.engine.capability import Allowance, Capabilities
from anysim.engine.presence import Lifecycle
from anysim.engine.requirements import crowded
from anysim.engine.state import SnapshotLevel
from anysim.model.world import World
from anysim_mechanics.journal_checks import refuse_pasts
from anysim_mechanics.meeting import refusals
from anysim_mechanics.one_world.base import OneWorldPerEnv
from anysim_sapien import declared
from anysim_sapien.options import SapienOptions

if TYPE_CHECKING:
    from anysim_sapien.envs import Envs


class SapienEngine(OneWorldPerEnv):
    """The engine `sapien`. Trajectories do not depend on the number of envs or their order."""

    name: ClassVar[str] = "sapien"
    capabilities: ClassVar[Capabilities] = declared.CAPABILITIES
    parameters: ClassVar[frozenset[str]] = declared.PARAMETERS
    lifecycle: ClassVar[Lifecycle] = Lifecycle.P1
    ragged_rows = frozenset({"journal"})
    audit_allowances: ClassVar[Mapping[str, Allowance]] = declared.AUDIT_ALLOWANCES
    library = declared.LIBRARY
    options_type = SapienOptions
    options: SapienOptions
    _envs: "Envs"

    @classmethod
    def findings(cls) -> tuple[Finding, ...]:
        """The Vulkan driver and how to choose one; threads."""
        from anysim_sapien.diagnosis import findings

        return findings()

    @classmethod
    def refusals(cls, world: World, options: Any) -> Sequence[str]:
        """Pairs of surfaces and exclusions that PhysX' filters cannot tell apart; more joints than it takes."""
        return [*crowded(world, declared.JOINTS, shapes=False), *refusals(world)]

    @classmethod
    def refuse_rows(cls, data: Mapping[str, Array], level: SnapshotLevel, world: World, options: object) -> None:
        if level is SnapshotLevel.TRAJECTORY:
            assert isinstance(options, SapienOptions)
            refuse_pasts(data, world, options.rebase_steps)

    def renderer_name(self) -> str:
        """The Vulkan device, such as `SwiftShader Device (Subzero), in software`."""
        from anysim_sapien.vulkan import open_device

        device = open_device(self.options.vulkan_icd)
        return f"{device.name}, {'in software' if device.is_cpu else 'on the GPU'}"

    def _make(self, world: World, present: Array) -> "Envs":
        from anysim_sapien.envs import Envs  # SAPIEN and numba, where a world is built

        return Envs(world, present, self.options)
