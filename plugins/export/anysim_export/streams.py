"""Streams of a recording, as its manifest tells of them."""

from typing import Any, NamedTuple

from anysim.record.manifest import Manifest, StreamEntry

CHANNELS = ("depth", "segmentation")


class Channel(NamedTuple):
    """Depth (H, W) float32 [m] of a camera, or segmentation (H, W) uint16, whose numbers are those of its legend."""

    camera: str
    name: str
    entry: StreamEntry

    @property
    def stream(self) -> str:
        """Its name in the recording."""
        return f"camera/{self.camera}/{self.name}"

    @property
    def key(self) -> str:
        """Its name in data sets whose images are called as their cameras are."""
        return f"{self.camera}_{self.name}"

    @property
    def size(self) -> tuple[int, int]:
        """Height and width."""
        height, width = (int(side or 0) for side in self.entry.shape)
        return height, width

    @property
    def about(self) -> dict[str, Any]:
        """What its numbers are: `unit`, `near` and `far` of depth, the `legend` of segmentation."""
        return {"unit": self.entry.unit, "dtype": self.entry.dtype, **self.entry.about}


def channels_of(manifest: Manifest) -> tuple[Channel, ...]:
    """Depth and segmentation that were recorded, by camera."""
    found = [(name.split("/"), entry) for name, entry in sorted(manifest.streams.items()) if entry.kind == "image"]
    return tuple(
        Channel(parts[1], parts[2], entry)
        for parts, entry in found
        if len(parts) == 3 and parts[0] == "camera" and parts[2] in CHANNELS
    )


def others_of(manifest: Manifest, *kinds: str) -> tuple[str, ...]:
    """Streams beside the numbers, videos, depth and segmentation: annotations and words, of these kinds or of all."""
    known = {one.stream for one in channels_of(manifest)}
    return tuple(
        name for name, entry in manifest.streams.items() if name not in known and (not kinds or entry.kind in kinds)
    )


def streams_of(manifest: Manifest) -> tuple[str, ...]:
    """Everything that a trajectory holds of each episode, as `open_trajectory(path).names()` without opening files."""
    layout = manifest.layout
    own = ("action", "annotation", "language", "collect/reward", "collect/status")
    arrays = (*(f"state/{name}" for name in layout.state), *(f"observation/{name}" for name in layout.obs))
    return (*own, *arrays, *(f"camera/{name}" for name in manifest.cameras), *manifest.streams)
