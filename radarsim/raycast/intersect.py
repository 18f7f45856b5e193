"""What rays do with the parts of a scene; see ``engine/intersect.hpp``."""

from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

# What a ray does with a part: its role.
IGNORE: Final = 0
COLLECT: Final = 1
OPAQUE: Final = 2
Roles: TypeAlias = NDArray[np.uint8]
