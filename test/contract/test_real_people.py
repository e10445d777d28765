"""The networks for a real camera find people on photographs; the figures are those of benchmarks/real_people.py.

The photographs are no part of the repository. The limits lie below what was measured on 28 November 2026, so that
another version of onnxruntime or of the JPEG decoder does not matter.
"""

from __future__ import annotations

import numpy as np
import pytest
from people_networks import NetworkFinder, look
from people_pictures import PEOPLE, Photograph, crop_legs, darken, read_set
from people_scores import average_precision, score

from rosbot_patrol.detection.detector import Detector
from rosbot_patrol.errors import PatrolError

pytestmark = pytest.mark.skipif(
    not (PEOPLE / "coco.json").is_file(), reason=f"the photographs are not here: {PEOPLE} has no coco.json"
)
LEAST = {  # what was measured: 0.87, 0, 0.77, 0.94, 0.81, 0.63 and 0.68, 1, 0.93, 0.91, 0.83, 0.22
    "yolo-fastest-1.1-xl": {"big": 0.82, "alarms": 1, "precision": 0.70, "ap": 0.91, "legs": 0.75, "dark": 0.56},
    "ssdlite": {"big": 0.62, "alarms": 2, "precision": 0.85, "ap": 0.87, "legs": 0.75, "dark": 0.15},
}


@pytest.fixture(scope="module")
def coco() -> list[Photograph]:
    return read_set(PEOPLE, "coco")


@pytest.fixture(scope="module")
def pedestrians() -> list[Photograph]:
    return read_set(PEOPLE, "pennfudan")


@pytest.fixture(scope="module", params=sorted(LEAST))
def network(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    load(name)
    return name


def load(name: str, threshold: float | None = None) -> Detector:
    try:
        return NetworkFinder(PEOPLE / "networks").load(name, threshold)
    except PatrolError as err:
        pytest.skip(f"{name} is not here: {err}")


def test_people_are_found_and_empty_pictures_are_quiet(network: str, coco: list[Photograph]) -> None:
    found, limit = score(look(load(network), coco)), LEAST[network]
    assert found.recall("big") >= limit["big"]
    assert found.alarms <= limit["alarms"]
    assert found.precision >= limit["precision"]


def test_people_in_the_dark(network: str, coco: list[Photograph]) -> None:
    assert score(look(load(network), darken(coco))).recall("big") >= LEAST[network]["dark"]


def test_pedestrians(network: str, pedestrians: list[Photograph]) -> None:
    assert average_precision(look(load(network, 0.02), pedestrians)) >= LEAST[network]["ap"]


def test_legs(network: str, pedestrians: list[Photograph]) -> None:
    answers = look(load(network), list(crop_legs(pedestrians)))
    assert np.mean([bool((one.matches() >= 0).any()) for one in answers]) >= LEAST[network]["legs"]
