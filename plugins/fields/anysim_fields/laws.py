"""Constants of jets and plumes; `kernels.air` says whose they are."""

DECAY, JET_SPREAD, PLUME_SPREAD = 6.06, 0.094, 0.12
"""Of a jet: how many diameters over the distance its speed is. Of both: where it is half as fast, over the distance."""
ROOM = 293.0
"""[K] of the air around."""
FLAME, PLUME = 0.08, 0.2
"""[m kW^-2/5] heights at which McCaffrey's flame becomes intermittent, and ends."""
