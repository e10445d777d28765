"""Check for a display that can show a window."""

from __future__ import annotations

import ctypes
import ctypes.util
import os


def display_problem() -> str:
    """Reason why no window can be opened, "" if one can. (OpenCV's Qt ends the program if it finds no display.)"""
    name = os.environ.get("DISPLAY", "")
    if not name:
        return "DISPLAY is not set"
    library = ctypes.util.find_library("X11")
    if library is None:
        return "libX11 is not installed"
    x11 = ctypes.CDLL(library)
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
    display = x11.XOpenDisplay(name.encode())
    if not display:
        return f"the display {name} does not answer"
    x11.XCloseDisplay(display)
    return ""
