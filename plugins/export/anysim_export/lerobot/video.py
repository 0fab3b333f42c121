"""Videos of LeRobot's data sets: one for each camera and episode, then those of many episodes in one file.

Every second image is whole, so that a trainer reads single images fast. Equal images give equal files.
"""

from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError

CODEC, PIXELS, BT709 = "h264", "yuv420p", 1
REPRODUCIBLE = "mbtree=0:rc-lookahead=0"
"""Parameters of x264 without which equal images may give different files."""


def padded(image: Array) -> Array:
    """An image whose sides are even, as the encoder wants them: the last row or column is repeated."""
    height, width = image.shape[:2]
    if height % 2 or width % 2:
        return np.pad(image, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
    return image


def one_thread() -> dict[str, int]:
    """Arguments of PyAV's conversions: from 17 on they start a thread a core for an image, which takes longer."""
    import av

    return {"threads": 1} if int(av.__version__.partition(".")[0]) >= 17 else {}


def encode(path: Path, images: Iterable[Array], rate: Fraction, crf: int) -> None:
    """Encode images (H, W, 3) uint8 with even sides into a file.

    Raises:
        RecordError: this PyAV has no encoder.
    """
    import av

    with av.open(str(path), "w", format="mp4") as container:
        try:
            options = {"crf": str(crf), "preset": "veryfast", "x264-params": REPRODUCIBLE, "g": "2", "bf": "0"}
            stream: Any = container.add_stream("libx264", rate=rate, options=options)
        except ValueError as error:
            raise RecordError("this PyAV has no H.264 encoder (libx264); install the `av` wheel from PyPI") from error
        stream.pix_fmt = PIXELS
        context = stream.codec_context
        context.thread_count = 1
        context.color_primaries = context.color_trc = context.colorspace = BT709
        alone = one_thread()
        for number, image in enumerate(images):
            if number == 0:
                stream.height, stream.width = image.shape[:2]
            rgb = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
            frame = rgb.reformat(format=PIXELS, dst_colorspace="ITU709", dst_color_range="MPEG", **alone)
            frame.pts, frame.time_base = number, 1 / rate
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def join(path: Path, parts: Sequence[tuple[Path, int]], rate: Fraction) -> None:
    """One file of several, each with its number of frames, one after the other and not encoded anew."""
    import av

    with av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"}) as container:
        out: Any = None
        done = 0
        for source, frames in parts:
            with av.open(str(source), "r", format="mp4") as part:
                stream: Any = part.streams.video[0]
                if out is None:
                    out = container.add_stream_from_template(stream)
                step = 1 / (rate * stream.time_base)
                offset = round(done * step)
                for packet in part.demux(stream):
                    if packet.dts is None:
                        continue
                    packet.pts, packet.dts = packet.pts + offset, packet.dts + offset
                    packet.stream = out
                    container.mux(packet)
            done += frames
