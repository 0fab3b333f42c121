"""Small Worlds by hand, as the contract suite names them; see `anysim.world.sketch`."""

from anysim.world.sketch import ORIGIN as ORIGIN, Sketch as Sketch, inertial as inertial
