"""Every tolerance of the contract suite, and why it has that size. What is not here is compared bit for bit."""

READ_BACK = 1e-5
"""[m, rad, m/s, rad/s], on values of order one: engines may compute in single precision (2^-24 relative, a few
operations), though the arrays they return are double."""

KINEMATICS = 2e-5
"""[m, quaternion components]: forward kinematics over a few links in single precision."""

DIFFERENCE = 2e-2
"""[m/s, rad/s] on speeds of order one: a one-step difference quotient against a velocity is off by half a step times
the acceleration (here up to 10 m/s^2 x 1 ms), and by single-precision rounding over the step (1e-7 m / 1 ms)."""

FALL_SPEED = 1e-4
"""Relative: gravity is constant, so any integrator has the speed of a free fall right; rounding adds up over 1000
steps."""

MOTION = 2.5e-3
"""Relative, on a motion under a constant force: first-order integrators are off by one step in time (half a step times
the speed), that is 1/n after n steps; the tests take n >= 400 and add nothing else."""

COASTING = 1e-3
"""Relative loss of speed allowed over 1 s without any force: rounding only. Engines that damp by default are caught."""

SPIN = 5e-3
"""Relative, on the rate of a fast spin over 1 s: semi-implicit integrators of the gyroscopic term lose a little."""

PERIOD = 5e-3
"""Relative, on a pendulum's period; a first-order integrator at 1 ms is within 2e-3."""

ENERGY = 1e-2
"""Relative to the energy turned over, double pendulum, 2 s at 0.5 ms: semi-implicit integrators stay within 5e-3."""

SLIDING = 5e-2
"""Relative, on the acceleration of a sliding block: contacts are regularised, and the block tilts on its soft contacts
for the first few steps."""

FRICTION = 2e-2
"""Absolute, on the coefficient of a pair: the impulse along over the impulse up in 0.15 s, while a box pitches and hops
on soft contacts; an engine that rounds its pairs' coefficients may be off by 0.005."""

CREEP = 5e-3
"""[m/s]: drift of a block that friction should hold. Regularised friction creeps; 5 mm/s over a second is visible."""

BOUNCE = {"exact": 5e-2, "approximate": 2e-1}
"""Relative, on the height after a bounce (e^2 times the drop). Discrete time catches the impact up to a step late;
an engine whose rule only approximates restitution says so in its capability and gets the wider one."""

RESTITUTION = {"exact": 3e-2, "approximate": 1.5e-1}
"""Absolute, on the ratio of speeds after and before a collision of two free bodies, 0 included: soft contacts give a
little back even where nothing should be."""

MOMENTUM = 1e-4
"""Relative: contact forces come in pairs, so only rounding may change the sum of momenta."""

REST_HEIGHT = 2e-3
"""[m]: soft contacts sink, up to 2 mm under the small weights used here."""

GROUND = 1e-3
"""[m]: where rays meet uneven ground, and how high a ball of 1 kg rests or rolls above it."""

ROLLING = 3e-2
"""Relative, on the distance of a ball that rolls down a ramp of triangles for 0.8 s: it crosses an edge every few
centimetres, and begins with a settling contact. Measured: 2.0 % slow on soft contacts, else below 1 %."""

WEIGHT = 2e-2
"""Relative, of the force on a contact sensor at rest against the weight: what is left of the settling."""

TRANSIENT, AT_REST = 5e-3, 1e-3
"""[rad or m]: a driven joint against the solution of its law, on the way and at the end."""

BLOCKED = 2e-2
"""Relative, of a blocked drive's torque against the law."""

LIMIT = 2e-2
"""[rad or m]: overshoot of a joint pressed against its limit; limits are soft constraints in most engines."""

LATE = 0.5
"""In distances of one step: a joint that meets its limit within a step is stopped there by engines that look ahead."""

DENT = 2e-3
"""[m for each m/s]: the distance of one step of 2 ms, by which discrete time may catch an impact late."""

FOLLOWER = 2e-3
"""[m or rad]: lag of a mimic joint during motion, where it is a soft constraint."""

HELD = 1e-4
"""[m]: between points that are held together, in motion; ten times that [rad] between axes."""

RAY = 1e-4
"""[m]: distances to boxes and planes, in single precision over a few metres."""

DEPTH = 1e-2
"""Relative: depth buffers are coarse far from the near plane."""

LEAK_BYTES = 24 * 2**20
"""Growth of the process over 40 worlds built and destroyed after warming up: allocators keep some pages, one leaked
world of the smallest engine measured here would cost several times this in total."""

ABSENT = 1e-5
"""[m, quaternion components]: what is there, after 300 steps with contacts, against a world without what is absent.
Solvers sum over other rows and stop by other scales; most engines are equal to the bit, none needs more than 1e-8."""

ABSENT_FORCE = 1e-2
"""[N] on forces of some 10 N, likewise: stiff contacts make much of a difference of 1e-9 m."""

MADE = 5e-2
"""Relative to what was turned over: mechanical energy that may appear where nothing acts but gravity and contacts."""

MADE_AT_REST = 2e-2
"""[J], likewise: soft contacts that begin a little inside each other push bodies of 1 kg up by 1 or 2 mm."""
