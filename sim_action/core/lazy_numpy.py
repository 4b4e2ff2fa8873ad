"""numpy, imported when it is first used: `--help` and `validate` load every assertion, and need no arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.random import Generator
    from numpy.typing import ArrayLike, NDArray

    FloatArray = NDArray[np.float64]
else:

    class _Later:
        """The module numpy: each attribute is looked up once."""

        def __getattr__(self, name: str) -> Any:
            import numpy as np

            value = getattr(np, name)
            setattr(self, name, value)
            return value

    np = _Later()
    # Annotations are not evaluated.
    ArrayLike = FloatArray = Generator = NDArray = None

__all__ = ["ArrayLike", "FloatArray", "Generator", "NDArray", "np"]
