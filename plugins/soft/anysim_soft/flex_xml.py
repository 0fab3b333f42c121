"""Words of MuJoCo's XML that all flexes need: how they touch, and numbers to the bit."""

from anysim.conventions import Array

SOLIMP = "0.99 0.999 0.001"


def contact_of(friction: float, dt: float, *, itself: bool = False) -> str:
    """How a flex touches: as it says, whatever it meets, but that the larger coefficient of friction acts.

    With `itself`, also where parts of it come to lie on each other.
    """
    touches = 'selfcollide="auto" contype="1"' if itself else 'selfcollide="none" contype="0"'
    return (
        f'<contact {touches} conaffinity="1" solmix="1e6" friction="{friction!r}" '
        f'solref="{2 * dt!r} 1" solimp="{SOLIMP}"/>'
    )


def numbers(values: Array) -> str:
    """Numbers in XML, to the bit."""
    return " ".join(repr(float(value)) for value in values)
