"""Limits of what one agent may ask for, beside those of every service."""

from dataclasses import dataclass

from anysim_serving.settings import Limits

SERVICE = Limits(sessions=4, envs=16, total_envs=32, pixels=4 << 20, body_bytes=1 << 20, linger_s=600.0)
"""Those of services, as an agent needs them: it thinks for minutes, and looks at few envs."""


@dataclass(frozen=True)
class AgentLimits:
    """What an agent gets at most.

    Attributes:
        yaml_bytes: of a world of its own.
        things: objects, robots and instances of such a world together.
        families: of such a world; each has limits of its own.
        cameras: of such a world.
        pixels: of one of its cameras, and of one image that is asked for.
        substeps: physics steps of one of its control steps.
        horizon: control steps of an episode.
        commands: of one `run_command`.
        snapshots: kept at once of one session; the oldest goes first.
        replay: control steps that one counterfactual repeats.
        wait_s: seconds for which one call waits for a command.
        page: entries of one answer of `list_catalog`.
    """

    yaml_bytes: int = 64 << 10
    things: int = 200
    families: int = 8
    cameras: int = 8
    pixels: int = 1 << 20
    substeps: int = 200
    horizon: int = 100_000
    commands: int = 20
    snapshots: int = 32
    replay: int = 5_000
    wait_s: float = 300.0
    page: int = 40


AGENT = AgentLimits()
"""Those of an agent whose server says nothing else."""
