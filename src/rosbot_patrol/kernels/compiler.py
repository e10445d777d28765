"""Compile all kernels ahead of time into one library, with numba's `pycc` and the C compiler of the system.

Source: "Compiling code ahead of time", https://numba.readthedocs.io.
"""

from __future__ import annotations

import importlib
import tempfile
import warnings
from pathlib import Path
from typing import Any

from numba.core.compiler import Flags
from numba.core.errors import NumbaPendingDeprecationWarning

from rosbot_patrol.files import PACKAGE, kernel_library, kernel_sources
from rosbot_patrol.kernels.decorator import LIBRARY, recording, symbol

with warnings.catch_warnings():  # numba replaces pycc one day; its version is fixed in scripts/requirements.txt
    warnings.simplefilter("ignore", NumbaPendingDeprecationWarning)
    from numba.pycc import CC
    from numba.pycc import compiler as pycc


class _Flags(Flags):  # type: ignore[misc]
    """pycc's flags, with the interpreter's lock released during a call, for which pycc has no switch."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.release_gil = True


def compile_library() -> Path:
    """Compile every `*_kernels.py` of the package for this processor; returns the library's path.

    Raises:
        numba.core.errors.NumbaError: a kernel does not fit its signature.
        distutils.errors.CompileError: there is no C compiler, or Python's headers are missing.
        OSError: the library cannot be written.
    """
    with recording() as kernels:
        for path in kernel_sources():
            importlib.import_module(".".join((PACKAGE.name, *path.relative_to(PACKAGE).with_suffix("").parts)))
    library = kernel_library()
    library.parent.mkdir(parents=True, exist_ok=True)
    pycc.Flags = _Flags
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:
        compiler = CC(LIBRARY)
        compiler.output_dir, compiler.target_cpu = folder, "host"
        for each in kernels:
            compiler.export(symbol(each.function), each.signature)(each.function)
        compiler.compile()
        Path(folder, compiler.output_file).replace(library)
    return library
