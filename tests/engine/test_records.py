"""Records of all envs: what lacks a row is refused before anything changes, and worlds are carried over by name."""

from dataclasses import replace

import pytest

from anysim.engine.records import EnvRecords
from anysim.errors import SnapshotError
from anysim.testing import worlds
from anysim.testing.kinematic import NullEngine


@pytest.mark.parametrize("name", ["ticks", "cameras", "fov", "commands.mode"])
def test_a_snapshot_that_lacks_a_row_is_refused_before_anything_changes(name: str) -> None:
    with NullEngine().create_world(worlds.scene(), 2) as engine:
        taken = engine.snapshot()
        engine.set_control(position=0.1)
        engine.step(3)
        before = engine.get_state().time, engine.control.position
        lacking = replace(taken, data={k: rows for k, rows in taken.data.items() if k != name})
        with pytest.raises(SnapshotError, match=f"'{name}' is missing"):
            engine.restore(lacking)
        assert (engine.get_state().time == before[0]).all()
        assert (engine.control.position == before[1]).all()


def test_commands_and_clocks_are_carried_by_name() -> None:
    world = worlds.scene()
    fewer = replace(world, actuators=world.actuators[1:])
    old, new = EnvRecords(world, 2), EnvRecords(fewer, 2)
    old.commands.control.position[:] = [[0.1 * i for i in range(len(world.actuators))]]
    old.ticks[:] = [5, 7]
    new.carry(old)
    assert (new.commands.control.position == old.commands.control.position[:, 1:]).all()
    assert new.ticks.tolist() == [5, 7]
