"""Hot loops as machine code, compiled once by the set-up.

`python -m rosbot_patrol.kernels` compiles every `*_kernels.py` of the package into one library. A node loads that
library in a millisecond and needs no compiler: numba would cost each node 115 MB and a second of its start.
"""

from rosbot_patrol.kernels.decorator import kernel

__all__ = ["kernel"]
