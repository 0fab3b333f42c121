"""One MP4 per camera: H.264 by PyAV, encoded as the images come. Equal images give equal files."""

from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from anysim.conventions import Array
from anysim.errors import RecordError

REPRODUCIBLE = "mbtree=0:rc-lookahead=0"
"""Parameters of x264: its macroblock tree, fed by the look-ahead, depends on uninitialised memory, and equal
images gave different files."""

CODEC = "h264"
BT709 = 1
"""The colour space that the file declares, and that images are converted to (value of ITU-T H.273)."""


def frame_rate(control_dt: float, every: int) -> Fraction:
    """Images per second of simulated time, as the ratio that the file's clock needs."""
    rate = 1 / (Fraction(control_dt).limit_denominator(1_000_000) * every)
    return rate.limit_denominator(100_000)


def one_thread() -> dict[str, int]:
    """Arguments of PyAV's conversions: from 17 on they start a thread a core for an image, which takes longer."""
    import av

    return {"threads": 1} if int(av.__version__.partition(".")[0]) >= 17 else {}


class VideoWriter:
    """Encodes (H, W, 3) uint8 images into a file. Odd sizes are padded by repeating the last column or row."""

    def __init__(self, path: Path, width: int, height: int, rate: Fraction, crf: int, preset: str) -> None:
        import av

        self.frames = 0
        self._pad = ((0, height % 2), (0, width % 2), (0, 0))
        self._clock = 1 / rate
        self._container: Any = av.open(str(path), "w", format="mp4", options={"movflags": "+faststart"})
        try:
            quality = {"crf": str(crf), "preset": preset, "x264-params": REPRODUCIBLE}
            stream: Any = self._container.add_stream("libx264", rate=rate, options=quality)
        except ValueError as error:
            self.abort()
            raise RecordError("this PyAV has no H.264 encoder (libx264); install the `av` wheel from PyPI") from error
        stream.width, stream.height = width + width % 2, height + height % 2
        stream.pix_fmt = "yuv420p"
        context = stream.codec_context
        context.thread_count = 1
        context.color_primaries = context.color_trc = context.colorspace = BT709
        self._stream = stream

    def write(self, image: Array) -> None:
        """Encode the next image."""
        import av

        if self._pad[0][1] or self._pad[1][1]:
            image = np.pad(image, self._pad, mode="edge")
        rgb = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
        frame = rgb.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG", **one_thread())
        frame.pts, frame.time_base = self.frames, self._clock
        self._container.mux(self._stream.encode(frame))
        self.frames += 1

    def close(self) -> None:
        """Write what the encoder still holds, and the file's index."""
        self._container.mux(self._stream.encode(None))
        self._container.close()

    def abort(self) -> None:
        """Close the file in whatever state."""
        from av.error import FFmpegError

        with suppress(OSError, FFmpegError):
            self._container.close()


def images(path: Path, width: int, height: int) -> Iterator[Array]:
    """The images (H, W, 3) uint8 of a file, one at a time.

    Raises:
        RecordError: it is not a video of this size, or is damaged.
    """
    alone = one_thread()
    for frame in _frames(path, width, height):
        yield frame.to_ndarray(format="rgb24", **alone)[:height, :width]


def check(path: Path, width: int, height: int, frames: int, fps: float) -> None:
    """Decode every frame of a file, and compare their number and times with what they should be.

    Raises:
        RecordError: it is not a video of this size, holds other frames, or one is damaged, which is named.
    """
    count = 0
    for count, frame in enumerate(_frames(path, width, height), start=1):
        if count > frames:
            break
        if frame.time is None or abs(frame.time * fps - (count - 1)) > 0.01:
            raise RecordError(
                f"{path}: frame {count - 1} is at {frame.time} s, and should be at {(count - 1) / fps:g} s"
            )
    if count != frames:
        raise RecordError(f"{path} has {count if count < frames else 'more'} frames; the manifest says {frames}")


def _frames(path: Path, width: int, height: int) -> Iterator[Any]:
    """The decoded frames of a file. What the decoder would conceal is an error."""
    import av
    from av.error import FFmpegError

    try:
        opened = av.open(str(path), "r", format="mp4")
    except (FFmpegError, ValueError) as error:
        raise RecordError(f"{path} cannot be read as a video: {getattr(error, 'strerror', None) or error}") from error
    number = 0
    try:
        with opened as container:
            stream = _stream(path, container, width, height)
            size = (stream.width, stream.height)
            for packet in container.demux(stream):
                for frame in packet.decode():
                    if frame.is_corrupt or (frame.width, frame.height) != size:
                        raise RecordError(f"{path}: frame {number} is damaged")
                    yield frame
                    number += 1
    except (FFmpegError, OverflowError, ValueError, MemoryError) as error:
        reason = getattr(error, "strerror", None) or error
        raise RecordError(f"{path}: frame {number}, or one soon after it, does not decode: {reason}") from error


def _stream(path: Path, container: Any, width: int, height: int) -> Any:
    """The one video stream, of the expected codec and size: a decoder's memory follows from it."""
    streams = [stream for stream in container.streams.video if stream.codec_context is not None]
    size = (width + width % 2, height + height % 2)
    if len(streams) != 1 or (streams[0].width, streams[0].height) != size:
        found = ", ".join(f"{s.width} x {s.height}" for s in streams) or "none"
        raise RecordError(f"{path} should hold one video of {size[0]} x {size[1]} pixels; it holds {found}")
    context = streams[0].codec_context
    if context.name != CODEC:
        raise RecordError(f"{path} should be encoded in {CODEC}; it is in {context.name}")
    # one thread, so that an error comes with its frame; and all that the decoder can notice is an error
    context.thread_count, context.options = 1, {"err_detect": "crccheck+bitstream+buffer+explode"}
    return streams[0]
