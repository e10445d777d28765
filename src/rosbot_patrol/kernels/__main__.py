"""Compile the kernels if they or the machine changed, as the set-up does: `python -m rosbot_patrol.kernels`."""

import importlib
import sys
import time

from rosbot_patrol.files import kernel_library

start = time.perf_counter()
if not kernel_library().exists():
    importlib.import_module("rosbot_patrol.kernels.compiler").compile_library()
sys.stdout.write(f"kernels ready in {time.perf_counter() - start:.1f} s: {kernel_library()}\n")
