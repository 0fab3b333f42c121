"""The lights of a world that asks for none. Whoever draws them otherwise betrays nobody's wish."""

from anysim.world.model import Light

DEFAULT_LIGHTS = (
    Light("key", direction=(-0.4, 0.3, -0.87), intensity=0.7),  # from the front right, as a lamp beside the viewer
    Light("fill", direction=(0.5, -0.6, -0.62), intensity=0.35),  # weaker, from the other side: no side is black
)
