"""Textures and materials for the worlds of the contract suite: plain ones, so that a picture says which they are."""

import numpy as np

from anysim.model.appearance import Material, Texture

_RED, _GREEN = (np.tile(np.array(c, dtype=np.uint8), (8, 8, 1)) for c in ((255, 0, 0), (0, 255, 0)))
_HALVES = np.concatenate([np.tile(np.array(c, dtype=np.uint8), (8, 16, 1)) for c in ((255, 0, 0), (0, 0, 255))])

TEXTURES = (
    Texture("red", _RED, hash="red"),
    Texture("green", _GREEN, hash="green"),
    Texture("halves", _HALVES, hash="halves"),
)
"""All red, all green, and red above blue."""

MATERIALS = (Material("lamp", emission=1.0), Material("dull", roughness=1.0, specular=0.0))
