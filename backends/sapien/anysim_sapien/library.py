"""The one place that imports SAPIEN: it warns at import that it brings its own Vulkan loader, which is no fault."""

import warnings
from typing import Any

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import sapien as _sapien

sapien: Any = _sapien
physx: Any = _sapien.physx

__all__ = ["physx", "sapien"]
