"""Numbers side by side: types for kernels that work on many environments, or many legs, in one instruction.

A `Lanes(n)` is n doubles, one for each environment; arithmetic on it is one vector instruction, or for n = 1
an ordinary one. The mechanics is written once, for a single leg, and compiled for one lane, four or eight:
no loop to vectorise, and a number has the same bits in each. `Plane(n)` is a planar vector of lanes, which
multiplies like a complex number; `Mask(n)` is truths, for `choose`; `Rows(n)` is memory, a row of lanes for
each name. Floats mix with lanes and are the same in each.

Lanes live inside kernels only: they come from `rows` and go back into them.
"""

import hoof_env.simd.layout
import hoof_env.simd.operators  # noqa: F401  both teach numba: fields and operators
from hoof_env.simd.functions import (
    across as across,
)
from hoof_env.simd.functions import (
    anywhere as anywhere,
)
from hoof_env.simd.functions import (
    choose as choose,
)
from hoof_env.simd.functions import (
    cross as cross,
)
from hoof_env.simd.functions import (
    dot as dot,
)
from hoof_env.simd.functions import (
    floor as floor,
)
from hoof_env.simd.functions import (
    gather_eight as gather_eight,
)
from hoof_env.simd.functions import (
    lane_sum as lane_sum,
)
from hoof_env.simd.functions import (
    larger as larger,
)
from hoof_env.simd.functions import (
    plane as plane,
)
from hoof_env.simd.functions import (
    quarter_turns as quarter_turns,
)
from hoof_env.simd.functions import (
    root as root,
)
from hoof_env.simd.functions import (
    size as size,
)
from hoof_env.simd.functions import (
    smaller as smaller,
)
from hoof_env.simd.memory import (
    columns as columns,
)
from hoof_env.simd.memory import (
    fill as fill,
)
from hoof_env.simd.memory import (
    lane_of as lane_of,
)
from hoof_env.simd.memory import (
    level as level,
)
from hoof_env.simd.memory import (
    nth as nth,
)
from hoof_env.simd.memory import (
    read as read,
)
from hoof_env.simd.memory import (
    rows as rows,
)
from hoof_env.simd.memory import (
    set_lane as set_lane,
)
from hoof_env.simd.memory import (
    store_vectors as store_vectors,
)
from hoof_env.simd.memory import (
    write as write,
)
