"""Choice of the detector from darknet_ros's parameters.

`auto` takes the best network for a real camera that is ready: what was downloaded, else what was installed without a
download. `python -m rosbot_patrol.detection.choice` prints which one that is.
"""

from __future__ import annotations

import dataclasses
import importlib
import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rosbot_patrol.detection.catalogue import CATALOGUE, REAL_CAMERA, check_file
from rosbot_patrol.detection.detector import Detector, load_detector
from rosbot_patrol.detection.identity import network_sum
from rosbot_patrol.detection.params import DarknetParams, Threshold
from rosbot_patrol.detection.quality import describe_quality
from rosbot_patrol.detection.second_opinion import UNSURE, WEAK, SecondOpinion
from rosbot_patrol.detection.ssd.model_file import GRAPH_SHA256
from rosbot_patrol.errors import DetectorError, ParamError
from rosbot_patrol.package_files import package_file, package_folder
from rosbot_patrol.params import load, unknown_name
from rosbot_patrol.yaml_files import read_mapping

log = logging.getLogger(__name__)

REAL_CAMERAS = (REAL_CAMERA, "ssdlite")
"""Networks that `auto` tries, the best one first."""
DOWNLOAD = f"rosrun rosbot_patrol download_weights {REAL_CAMERA}"
INSTALL = "scripts/bootstrap --robot"
_SUMS = {"ssdlite": GRAPH_SHA256}
"""Sums of networks that come with a package."""
_MODULES = {"hog": ("hog", "HogDetector"), "ssdlite": ("ssdlite", "load_ssdlite")}


@dataclass(frozen=True, kw_only=True)
class NetworkFolders:
    """Folders of the networks' files.

    Args:
        own: our own network, `models/` of this package.
        darknet: the package darknet_ros, with `config/NAME.yaml` and `yolo_network_config/`.
    """

    own: Path
    darknet: Path


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A detector that is ready to run, and what is known of it.

    Args:
        detector: the detector.
        network: its name, as `network:=` takes it.
        sha256: of its cfg and weights, "" if it has none.
        threshold: of its boxes.
        second: name of the network that gives the second opinion, "" for none.
        passed_over: a sentence for each wanted or better network that is not ready.
    """

    detector: Detector
    network: str
    sha256: str = ""
    threshold: float = 0.0
    second: str = ""
    passed_over: tuple[str, ...] = ()

    def describe(self) -> str:
        """Which networks run, and how good they are."""
        second = f"; second opinion by {self.second}, which {describe_quality(self.second)}" if self.second else ""
        return f"{self.network} {describe_quality(self.network)}{second}"


def choose_detector(params: DarknetParams, folders: NetworkFolders) -> Choice:
    """Make the detector that the parameters name.

    Raises:
        DetectorError: its files are missing or damaged, or do not fit; for `auto`, no network is ready.
        ParamError: the settings of a network cannot be read.
    """
    choice = _choose_ready(params, folders) if params.network == "auto" else _load(params, folders)
    log.info("the network %s, by %s", choice.describe(), choice.detector.runtime)
    return choice


def open_network(name: str, threshold: float = 0.0) -> Choice:
    """Make the detector that `network:=NAME` makes, from the files of the installed packages.

    Args:
        name: of the network.
        threshold: of its boxes; 0: as its settings say.

    Raises:
        DetectorError: as `choose_detector`.
        ParamError: likewise, or there is no network of this name.
    """
    folders = NetworkFolders(own=package_file("models"), darknet=package_folder("darknet_ros"))
    return choose_detector(_with_threshold(network_settings(name, DarknetParams(), folders), threshold), folders)


def network_settings(name: str, params: DarknetParams, folders: NetworkFolders) -> DarknetParams:
    """Parameters with the settings of the network of this name, and the folders where its files belong.

    Raises:
        ParamError: there are no such settings, or they cannot be used.
    """
    settings = {path.stem: path for path in sorted((folders.darknet / "config").glob("*.yaml"))}
    settings |= {"house": folders.own / "house.yaml"}
    if name not in settings:
        raise ParamError(str(folders.darknet / "config"), unknown_name(name, settings))
    given = load(DarknetParams, read_mapping(settings[name], keys="of darknet_ros"), name=f"{settings[name]}: ")
    shared = folders.darknet / "yolo_network_config"
    cfgs, weights = (folders.own, folders.own) if name == "house" else (shared / "cfg", shared / "weights")
    return dataclasses.replace(
        params,
        network=given.network,
        yolo_model=given.yolo_model,
        config_path=str(cfgs),
        weights_path=str(weights),
    )


def _choose_ready(params: DarknetParams, folders: NetworkFolders) -> Choice:
    passed_over: list[str] = []
    for name in REAL_CAMERAS:
        settings = network_settings(name, params, folders)
        settings = dataclasses.replace(
            settings,
            config_path=params.config_path or settings.config_path,
            weights_path=params.weights_path or settings.weights_path,
        )
        settings = _with_threshold(settings, params.yolo_model.threshold.value)
        try:
            _check_download(name, settings, folders)
            choice = _load(settings, folders)
        except DetectorError as err:
            passed_over.append(f"{name} is not ready: {err}")
        else:
            for sentence in passed_over:
                log.warning("%s; to get it: %s", sentence, DOWNLOAD)
            return dataclasses.replace(choice, passed_over=(*passed_over, *choice.passed_over))
    raise DetectorError(
        f"no network for a real camera: {'; '.join(passed_over)}. Fetch one with `{DOWNLOAD}`, "
        f"or let `{INSTALL}` set up both"
    )


def _with_threshold(params: DarknetParams, threshold: float) -> DarknetParams:
    """The same with a threshold; 0: unchanged."""
    model = dataclasses.replace(params.yolo_model, threshold=Threshold(value=threshold))
    return dataclasses.replace(params, yolo_model=model) if threshold else params


def _check_download(name: str, settings: DarknetParams, folders: NetworkFolders) -> None:
    """Check that a network's downloaded files are whole; DetectorError with what is wrong with one."""
    if name in CATALOGUE:
        cfg, weights = settings.network_files(str(folders.own))
        for file in CATALOGUE[name].files:
            check_file(Path(cfg if file.is_cfg else weights), file)


def _load(params: DarknetParams, folders: NetworkFolders) -> Choice:
    """Load the network of these settings, and the one for a second opinion."""
    threshold = params.threshold
    if not params.second_opinion:
        return _choice(_make(params, folders, threshold), params, folders)
    network = _name(params, folders)
    other = network_settings(params.second_opinion, params, folders)
    if other.network == "auto":
        raise ParamError("second_opinion", "is auto, expected the name of a network")
    other_threshold = other.threshold
    try:
        if params.second_opinion == network:
            raise DetectorError("it is the first network already")
        second = _make(other, folders, min(WEAK, other_threshold))
    except DetectorError as err:
        problem = f"no second opinion by {params.second_opinion}: {err}"
        log.warning(problem)
        alone = _choice(_make(params, folders, threshold), params, folders)
        return dataclasses.replace(alone, passed_over=(problem,))
    first = _make(params, folders, min(UNSURE, threshold))
    both = SecondOpinion(first, second, threshold=threshold, second_threshold=other_threshold)
    return dataclasses.replace(_choice(both, params, folders), second=params.second_opinion)


def _name(params: DarknetParams, folders: NetworkFolders) -> str:
    return params.network if params.network in _MODULES else Path(params.network_files(str(folders.own))[0]).stem


def _choice(detector: Detector, params: DarknetParams, folders: NetworkFolders) -> Choice:
    """A detector with what is known of its network, whose files could be loaded."""
    has_files = params.network not in _MODULES
    files = map(Path, params.network_files(str(folders.own))) if has_files else ()
    sha256 = network_sum(*files) if has_files else _SUMS.get(params.network, "")
    return Choice(detector=detector, network=_name(params, folders), sha256=sha256, threshold=params.threshold)


def _make(params: DarknetParams, folders: NetworkFolders, threshold: float) -> Detector:
    if params.network in _MODULES:
        return _maker(params.network)(threshold=threshold, threads=params.threads)
    cfg, weights = params.network_files(str(folders.own))
    names = params.yolo_model.detection_classes.names
    return load_detector(cfg, weights, names, threshold=threshold, threads=params.threads)


def _maker(network: str) -> Callable[..., Detector]:
    """The function that makes such a detector; imported late, as it may bring OpenCV, 98 MB."""
    module, name = _MODULES[network]
    try:
        found: Callable[..., Detector] = getattr(importlib.import_module(f"rosbot_patrol.detection.{module}"), name)
    except ModuleNotFoundError as err:
        raise DetectorError(f"{network} needs the module {err.name}, which is not installed") from err
    return found


def main() -> None:
    """Print which network `auto` takes here, and why no better one, without a log."""
    logging.disable()
    try:
        choice = open_network("auto")
    except DetectorError as err:
        print(f"The guard has {err}")
        return
    for sentence in choice.passed_over:
        print(f"{sentence}; to get it: {DOWNLOAD}")
    print(f"With a real camera, the guard uses {choice.network}: it {describe_quality(choice.network)}")


if __name__ == "__main__":
    main()
