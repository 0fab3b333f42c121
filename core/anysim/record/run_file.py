"""run.json: what all trajectories of a directory have in common."""

from pathlib import Path

from anysim.errors import RecordError, listing
from anysim.record import commit as protocol
from anysim.record.header import RunHeader
from anysim.record.json import dump_json
from anysim.record.manifest import RunRecord, read_run
from anysim.record.names import RUN_FILE


def describe_run(out: Path, incoming: Path, run: RunHeader) -> None:
    """Write run.json by way of `incoming`, or see that it says the same.

    Raises:
        RecordError: the directory holds the trajectories of another run.
        OSError: it cannot be written.
    """
    record = RunRecord.model_validate(dict(run))
    path = out / RUN_FILE
    if path.exists():
        theirs, ours = read_run(out).to_dict(), record.to_dict()
        differing = sorted(key for key in {*theirs, *ours} if theirs.get(key) != ours.get(key))
        if differing:
            raise RecordError(
                f"{out} holds the trajectories of another run: {listing(differing)} differ"
                f"{'s' if len(differing) == 1 else ''} from {path}; record into another directory"
            )
        return
    aside = incoming / RUN_FILE
    aside.unlink(missing_ok=True)
    try:
        protocol.write_durably(aside, dump_json(record.to_dict(), "run"))
        protocol.publish(aside, path)
    except OSError:
        aside.unlink(missing_ok=True)
        raise
