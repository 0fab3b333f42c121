"""Small Worlds by hand, as the contract suite names them; see `anysim.world.sketch`."""

from anysim.world.sketch import ORIGIN as ORIGIN
from anysim.world.sketch import Sketch as Sketch
from anysim.world.sketch import inertial as inertial
