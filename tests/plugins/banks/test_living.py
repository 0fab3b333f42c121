"""The living bank in physics: a candidate set in a bad order becomes a good one by what came of its candidates."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from anysim.api import compile_world
from anysim.skills.living_bank import LivingBank
from anysim_banks.gripper import gripper
from anysim_banks.making import Order, made
from anysim_banks.method import Grasps
from anysim_banks.sampling import Candidates
from anysim_banks.subject import subjects
from anysim_banks.trial import Trial

EPISODES, RUNS = 8, 6


@pytest.mark.parametrize("living", [False, True], ids=["off", "on"])
def test_outcomes_raise_the_yield_of_a_badly_ordered_bank(tmp_path: Path, living: bool) -> None:
    """The bank was made for a light box; the one that is lifted is heavy, and what it trusts most lets that go."""
    hand = gripper()
    light, heavy = (
        compile_world({"world": {"objects": {"box": {"source": {"box": [0.04, 0.06, 0.1]}, "mass": mass}}}})
        for mass in (0.1, 2.2)
    )
    bank, _ = made(Grasps(subjects(light, "box")[0], hand), "mujoco", Order(200, 24), print)
    every = Candidates(bank.pose, bank.width, np.array(bank.kind), np.zeros(len(bank), dtype=int))
    with Trial(hand, subjects(heavy, "box")[0], "mujoco", envs=24) as trial:
        held = trial.run(every, hard=False).margin >= 1.0
    assert 3 <= held.sum() <= len(bank) - 3
    bank = replace(bank, margin=np.where(held, 2.0, 4.0))

    yields: list[float] = []
    for _ in range(RUNS):
        counts = LivingBank(bank, "mujoco", tmp_path)
        order = bank.ranked(belief=counts.belief if living else None)
        chosen = [int(order[episode % 4]) for episode in range(EPISODES)]  # as four candidates are packed as goals
        for candidate in chosen:
            counts.note(candidate, success=bool(held[candidate]))
        counts.save()
        yields.append(float(held[chosen].mean()))
    assert yields[0] == 0.0
    assert (yields[-1] == 1.0) == living, yields
