"""A builder of TFDS for a data set of `anysim export --to rlds-ready`: python anysim_rlds.py data/rlds data/tfds."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import tensorflow as tf  # pyright: ignore[reportMissingImports]
import tensorflow_datasets as tfds  # pyright: ignore[reportMissingImports]


class AnysimRlds(tfds.core.GeneratorBasedBuilder):
    """Episodes of steps, as RLDS has them."""

    VERSION = tfds.core.Version("1.0.0")
    pkg_dir_path = Path(__file__).parent  # so that the file can be run by itself

    def __init__(self, *, source: Path, **rest: Any) -> None:
        self._source = source
        self._about = json.loads((source / "features.json").read_text())
        super().__init__(**rest)

    def _info(self) -> tfds.core.DatasetInfo:
        step: dict[str, Any] = {"observation": {}}
        for name, one in self._about["steps"].items():
            kind = tfds.features.Tensor(shape=one["shape"], dtype=np.dtype(one["dtype"]))
            _put(step, name, kind if one["shape"] else tfds.features.Scalar(dtype=np.dtype(one["dtype"])))
        for name, one in self._about["images"].items():
            _put(
                step, name, tfds.features.Image(shape=one["shape"], dtype=np.dtype(one["dtype"]), encoding_format="png")
            )
        for name in self._about["words"]:
            step[name] = tfds.features.Text()
        about = {name: tfds.features.Text() for name in ("episode_seed", "status", "task", "robot")}
        features = {"steps": tfds.features.Dataset(step), "episode_metadata": about}
        return self.dataset_info_from_configs(features=tfds.features.FeaturesDict(features))

    def _split_generators(self, dl_manager: tfds.download.DownloadManager) -> dict[str, Any]:
        return {name: self._generate_examples(*part) for name, part in self._about["splits"].items()}

    def _generate_examples(self, first: int, stop: int) -> Iterator[tuple[int, dict[str, Any]]]:
        for number in range(first, stop):
            folder = self._source / "episodes" / f"{number:06d}"
            words = json.loads((folder / "words.json").read_text())
            with np.load(folder / "steps.npz") as arrays:
                rows = dict(arrays)
            steps: list[dict[str, Any]] = []
            for t in range(words["steps"]):
                step: dict[str, Any] = {"observation": {}}
                for name, values in rows.items():
                    _put(step, name, values[t])
                for name, one in self._about["images"].items():
                    path = str(folder / one["camera"] / f"{t:06d}.png")
                    _put(step, name, _depth(path) if one["dtype"] == "float32" else path)
                steps.append(step | {name: words[name][t] for name in self._about["words"]})
            yield number, {"steps": steps, "episode_metadata": words["episode_metadata"]}


def _depth(path: str) -> Any:
    """(H, W, 1) float32 [m], whose four bytes are a pixel of the file; TFDS takes no path of these."""
    return tf.io.decode_png(tf.io.read_file(path), channels=4).numpy().view("<f4")


def _put(step: dict[str, Any], name: str, value: Any) -> None:
    """`observation/NAME` belongs in the dictionary of observations."""
    group, _, key = name.rpartition("/")
    (step[group] if group else step)[key] = value


if __name__ == "__main__":
    AnysimRlds(source=Path(sys.argv[1]), data_dir=sys.argv[2]).download_and_prepare()
