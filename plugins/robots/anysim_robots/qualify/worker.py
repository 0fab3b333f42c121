"""One robot on one engine in a process of its own: `python -m anysim_robots.qualify.worker JOB.json`.

What it is at goes to stdout, a line each; what it found into the file that the job names. Physics engines are C++: what
one of them does to its process must not take the others along.
"""

import json
import sys
from pathlib import Path
from typing import Any

from anysim.errors import AnysimError


def main(job: dict[str, Any]) -> None:
    """Do a job: `robot`, `engine`, `durations` (null for no checks), `picture` and its `size`, `out`."""
    from anysim.assets.catalogue import load_robot
    from anysim_robots.qualify.result import as_data
    from anysim_robots.qualify.run import Durations, qualify

    def tell(words: str) -> None:
        print(words, flush=True)  # noqa: T201  the protocol of this program

    answer: dict[str, Any] = {}
    if job["picture"]:
        tell("picture")
        try:
            _draw(load_robot(job["robot"]), job)
            answer["picture"] = job["picture"]
        except (AnysimError, RuntimeError) as error:
            answer["undrawn"] = str(error)
    if job["durations"] is not None:
        try:
            answer["found"] = as_data(qualify(job["robot"], job["engine"], Durations(*job["durations"]), tell))
        except AnysimError as error:
            answer["error"] = str(error)
    Path(job["out"]).write_text(json.dumps(answer), encoding="utf-8")


def _draw(entry: Any, job: dict[str, Any]) -> None:
    from PIL import Image

    from anysim_robots.qualify.portrait import portrait

    Image.fromarray(portrait(entry, job["engine"], tuple(job["size"]))).save(job["picture"], optimize=True)


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))
