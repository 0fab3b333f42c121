"""An engine whose library is missing, as after a half-done installation."""

from importlib import import_module

from anysim.testing.kinematic import NullEngine

solver = import_module("warp_drive_solver")


class BrokenEngine(NullEngine):
    """Never defined."""

    name = "broken"
