"""Principal axes of inertia as MuJoCo has them: descending moments, orientations wxyz."""

from anysim.conventions import Array, wxyz_from_xyzw, xyzw_from_wxyz
from anysim.kinematics import inertia as neutral


def principal(inertia: Array) -> tuple[Array, Array]:
    """Principal moments (3,) and their frame (4,) wxyz of one tensor (xx, yy, zz, xy, xz, yz) [kg m^2]."""
    found = neutral.principal(inertia, descending=True)
    return found.moments, wxyz_from_xyzw(found.frame)


def full(moments: Array, frame: Array) -> Array:
    """Tensors (..., 6) of principal moments (..., 3) in frames (..., 4) wxyz."""
    return neutral.from_principal(moments, xyzw_from_wxyz(frame))
