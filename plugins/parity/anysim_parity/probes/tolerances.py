"""Every tolerance of the probes, and why it has that size. Those that follow from the time step are said there."""

REST_HEIGHT = 1e-3
"""[m]: what a body sinks into the ground, or floats above it, before a camera or a gripper would notice."""

WEIGHT = 1e-2
"""Relative, of a contact force at rest: settling is over, so only the solver's residual is left."""

CREEP = 1e-3
"""[m/s]: of a body that friction or the ground should hold. At 1 mm/s an object leaves its place by a finger's width
in ten seconds."""

RESTITUTION = 0.05
"""Of the coefficient; heights get what that makes of e^2 h. The impact falls between two steps, so no engine in
discrete time is exact; 0.05 is less than two balls of one make differ by."""

SLIDING = 2e-2
"""Relative, of a distance or an acceleration under sliding friction: friction regularised over the first steps, and the
first-order integrator, are each below 1 %."""

ROLLING = 2e-2
"""Relative, of the acceleration of a rolling body: as for sliding."""

ANGLE = 0.3
"""[degrees]: one spacing of the slopes tried (0.25) and a little: a threshold is known no better."""

STACK_HEIGHT = 2e-3
"""[m]: of the top of five boxes, each contact with a fifth of twice what a single body may sink."""

STACK_DRIFT = 2e-3
"""[m] over two seconds: what `CREEP` would give a single body."""

GRIP = 2e-2
"""Relative, of a finger's force: the contract's bound for blocked drives."""

HOLD = 3e-2
"""Of the ratio of grip to the least that holds: one spacing of the grips tried (0.025) and a little."""

PAIR = 2e-2
"""Of a coefficient of friction that was measured: 1 % of the deceleration, and what the first steps add."""

SLIP = 1e-3
"""[m]: what a held object may slide in a lift, or in two seconds of holding, without missing a placement of 1 mm."""
