"""Images as H.264 that foxglove.CompressedVideo takes: no frame follows from a later one."""

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim_mcap.video import BT709, REPRODUCIBLE

KEYFRAMES = 30
"""A viewer that jumps begins at most so many images before."""


def h264(images: Iterator[tuple[int, Array]], crf: int) -> Iterator[tuple[int, bytes]]:
    """Each image (H, W, 3) uint8 with its control step as one access unit: Annex B, parameters before key frames.

    Odd sizes are padded by repeating the last column or row; equal images give equal bytes.
    """
    import av

    codec: Any = None
    for number, (step, image) in enumerate(images):
        image = np.pad(image, ((0, image.shape[0] % 2), (0, image.shape[1] % 2), (0, 0)), mode="edge")
        if codec is None:
            codec = av.CodecContext.create("libx264", "w")
            codec.height, codec.width = image.shape[:2]
            codec.pix_fmt, codec.time_base = "yuv420p", Fraction(1, 30)
            codec.thread_count, codec.gop_size = 1, KEYFRAMES
            extra = f"{REPRODUCIBLE}:repeat-headers=1:annexb=1:bframes=0:scenecut=0"
            codec.color_primaries = codec.color_trc = codec.colorspace = BT709
            codec.options = {"crf": str(crf), "preset": "veryfast", "tune": "zerolatency", "x264-params": extra}
        rgb = av.VideoFrame.from_ndarray(image, format="rgb24")
        frame = rgb.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")
        frame.pts = number
        yield step, b"".join(bytes(packet) for packet in codec.encode(frame))
