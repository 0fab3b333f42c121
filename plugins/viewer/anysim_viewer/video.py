"""Videos of a view: the pictures of a camera, in the files that the env's record writer makes."""

from pathlib import Path

from anysim.conventions import Array
from anysim.errors import RecordError
from anysim.managers.camera import interval
from anysim.record.header import CameraInfo, EpisodeHeader, Header
from anysim.record.writer import make_writer
from anysim.task.env import TaskEnv
from anysim_recording.collector import run_header


class Video:
    """A video that is being made.

    Attributes:
        camera: whose pictures they are.
        every: control steps from one picture to the next.
        frames: written so far.
    """

    def __init__(self, env: TaskEnv, i: int, camera: str, first: Array, out: Path) -> None:
        """Begin a file in a new folder of `out`, with a picture (H, W, 3) uint8.

        Raises:
            RecordError: the writer of the task's records makes no videos, or the folder cannot be made.
        """
        record = env.spec.record
        writer = make_writer(record.writer, record.options)
        run = run_header(env, 0)
        self.camera, self.frames = camera, 0
        self.every = interval(run.control_dt, record.fps)
        info = CameraInfo(width=first.shape[1], height=first.shape[0], every=self.every)
        seed = int(env.streams.episode_seed[i])
        self._folder = _new_folder(out, f"{env.name}-{env.engine.name}")
        writer.prepare(run)
        header = Header(run, EpisodeHeader(env=i, episode=0, episode_seed=seed, cameras={camera: info}))
        self._shape, self._images = first.shape, writer.open_images(self._folder, header)
        self.add(first)

    def add(self, image: Array) -> None:
        """Write the next picture."""
        if image.shape != self._shape:
            raise RecordError(
                f"a picture of a video of {self._shape} is {image.shape}; end the video and begin another"
            )
        self._images.append({self.camera: image})
        self.frames += 1

    def finish(self) -> Path:
        """Complete the file, and say where it is."""
        (written,) = self._images.finish()
        return self._folder / written.name

    def abort(self) -> None:
        """Close the file as it is."""
        self._images.abort()


def _new_folder(out: Path, name: str) -> Path:
    for number in range(1, 10_000):
        folder = out / f"{name}-{number:03d}"
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise RecordError(
                f"no video can be written into {out}: {error.strerror or error}; choose another --out"
            ) from None
        return folder
    raise RecordError(f"{out} is full of videos of {name}; choose another --out")
