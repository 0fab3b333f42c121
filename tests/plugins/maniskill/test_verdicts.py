"""Verdicts of ManiSkill and robosuite on 1,000 states around each boundary: `make test-maniskill` runs these."""

from importlib.util import find_spec

import pytest

from anysim.errors import PluginError, TaskError
from anysim_maniskill.verdicts.pair import Pair, agreements
from anysim_maniskill.verdicts.table import PAIRS, chosen

PACKAGES = {"maniskill": "mani_skill", "robosuite": "robosuite"}


def pair_of(peer: str) -> Pair:
    (found,) = chosen([peer])
    return found


@pytest.mark.parametrize("peer", [pair.peer for pair in PAIRS])
@pytest.mark.filterwarnings("ignore")  # peers warn of what they lack
def test_a_peer_disagrees_only_where_it_is_listed(peer: str) -> None:
    package = PACKAGES[peer.partition(":")[0]]
    if find_spec(package) is None:
        pytest.skip(f"{package} is not installed: make test-maniskill")
    found = agreements(pair_of(peer), 1000, 0)
    for one in found:
        assert one.unexplained == 0, one
        assert one.differ <= sum(one.by.values()), one
    assert any(0 < one.theirs < one.states for one in found)  # a peer that says one thing only checks nothing


@pytest.mark.parametrize("peer", ["maniskill:PickCube-v1", "robosuite:Lift"])
def test_a_missing_peer_says_how_to_install_it(peer: str) -> None:
    if find_spec(PACKAGES[peer.partition(":")[0]]) is not None:
        pytest.skip("it is installed")
    with pytest.raises(PluginError, match="pip install"):
        agreements(pair_of(peer), 2, 0)


def test_pairs_are_chosen_by_peer_and_by_task() -> None:
    assert [pair.peer for pair in chosen(["stack_cube"])] == ["maniskill:StackCube-v1", "robosuite:Stack"]
    assert len(chosen(["maniskill"])) == 9
    assert chosen([]) == list(PAIRS)
    with pytest.raises(TaskError, match=r"there is no such pair.*expected a peer"):
        chosen(["maniskill:PickCup-v1"])
