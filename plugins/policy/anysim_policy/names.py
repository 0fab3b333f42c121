"""Names of observations as others have them, from the words of an option."""

from collections.abc import Sequence

from anysim.errors import TaskError, listing


def named(text: str, known: Sequence[str], task: str, example: str) -> dict[str, str]:
    """Our names by theirs, of `THEIRS:OURS` joined by `+`; empty where nothing is said.

    Raises:
        TaskError: at `policy.keys`, of another form, none of `known`, or one of theirs is there twice.
    """
    parts = text.split("+") if text else []
    pairs = [(theirs, ours) for theirs, _, ours in (part.rpartition(":") for part in parts)]
    for theirs, ours in pairs:
        if not theirs or ours not in known:
            raise TaskError(
                f"policy.keys: '{theirs}:{ours}' is no THEIRS:OURS with an observation of '{task}' "
                f"(observations: {listing(known, 20)}); as in keys={example}:{known[0]}"
            )
    if len(dict(pairs)) < len(pairs):
        raise TaskError(f"policy.keys: each of their names once; got {text}")
    return dict(pairs)
