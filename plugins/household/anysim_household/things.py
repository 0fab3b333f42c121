"""The things of this pack, by name, as the entry points of `anysim.assets` ask for them."""

from pathlib import Path

from anysim_household.pack import pack

OBJECTS = Path(__file__).parent / "objects"
__getattr__ = pack(OBJECTS)
