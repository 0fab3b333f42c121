"""Depth and segmentation in LeRobot's frames: images of one channel, which its loader gives as they are.

LeRobot 0.4 has no feature of depth. What it reads as an `image` may be a TIFF of float32, which comes out in metres
unscaled, or a PNG of 16 bits, which comes out as int16; both without loss.
"""

import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim_export.api import Episode, png
from anysim_export.lerobot.stats import Stats, sampled, stats_of, thinned
from anysim_export.streams import Channel

CHANNELS = "channels.parquet"
MOST_ENTITIES = (1 << 15) - 1


def check(channels: Sequence[Channel]) -> None:
    """Refuse a legend whose numbers LeRobot would read as negative ones."""
    for one in channels:
        if len(one.about.get("legend", ())) > MOST_ENTITIES:
            raise RecordError(f"LeRobot reads numbers up to {MOST_ENTITIES}, and '{one.stream}' has more entities")


def write(path: Path, channels: Sequence[tuple[str, Channel]], episode: Episode) -> dict[str, Stats]:
    """The columns of an episode by the names of their features, as a table, and the statistics of each."""
    import pyarrow as pa  # pyright: ignore[reportMissingImports]
    import pyarrow.parquet as pq  # pyright: ignore[reportMissingImports]

    columns: dict[str, Any] = {}
    stats: dict[str, Stats] = {}
    wanted = set(sampled(episode.steps).tolist())
    for name, channel in channels:
        files, pixels = list[bytes](), list[Array]()
        for t, image in _images(episode, channel):
            files.append(_tiff(image) if channel.name == "depth" else png(image))
            if t in wanted:
                pixels.append(thinned(image).ravel())
        columns[name] = pa.StructArray.from_arrays(
            [pa.array(files, pa.binary()), pa.nulls(len(files), pa.string())], names=["bytes", "path"]
        )
        found = stats_of(np.concatenate(pixels)[:, None])
        stats[name] = {key: value.reshape(1, 1, 1) for key, value in found.items()} | {"count": np.array([len(pixels)])}
    pq.write_table(pa.table(columns), path, compression="none")  # the images are compressed
    return stats


def feature(channel: Channel) -> dict[str, Any]:
    """What `info.json` says of it."""
    shape = [*channel.size, 1]
    return {"dtype": "image", "shape": shape, "names": ["height", "width", "channels"], "info": channel.about}


def _images(episode: Episode, channel: Channel) -> Iterator[tuple[int, Array]]:
    return zip(range(episode.steps), episode.channel(channel), strict=False)


def _tiff(image: Array) -> bytes:
    from PIL import Image

    packed = io.BytesIO()
    Image.fromarray(image).save(packed, "tiff", compression="tiff_adobe_deflate")
    return packed.getvalue()
