"""A guard robot for a home or office, on ROS 1, in Python."""

import os

# Where OpenBLAS is installed, it would start a thread for each core in each node, and they would starve one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
