"""The pairs of all peers, and those that are named."""

from collections.abc import Sequence

from anysim.errors import TaskError, suggest
from anysim_maniskill.verdicts import maniskill_pairs, robosuite_pairs
from anysim_maniskill.verdicts.pair import Pair

PAIRS: tuple[Pair, ...] = (*maniskill_pairs.PAIRS, *robosuite_pairs.PAIRS)


def chosen(names: Sequence[str]) -> list[Pair]:
    """The pairs of peers (`maniskill`), peers' tasks (`maniskill:PickCube-v1`) or tasks of ours; all without a name.

    Raises:
        TaskError: there is none of a name.
    """
    known = {word for pair in PAIRS for word in (pair.peer, pair.peer.partition(":")[0], pair.task)}
    for name in names:
        if name not in known:
            raise TaskError(
                f"anysim verdicts {name}: there is no such pair{suggest(name, sorted(known))}; expected a peer, its "
                f"task or one of ours: {', '.join(pair.peer for pair in PAIRS)}"
            )
    return [pair for pair in PAIRS if not names or {pair.peer, pair.peer.partition(":")[0], pair.task} & set(names)]
