"""What can be said of a page's command without running it: files, programs, arguments, options, messages.

A command that names what is not there is a fault of the page or of the program. Nothing is started.
"""

from __future__ import annotations

import functools
import io
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import genpy
import roslaunch.arg_dump
import roslaunch.config
import roslaunch.xmlloader
import roslib.message
import roslib.packages
import rospkg
import yaml
from page_commands import Command

ROOT = Path(__file__).resolve().parents[2]
SERVICE_PACKAGES = ("rosbot_patrol", "std_srvs", "nav_msgs")
ROSBAG_VERBS = {"record", "play", "info", "reindex", "decompress", "compress", "check", "fix", "filter"}
PLACEHOLDER = re.compile(r"[A-Z]+(_[A-Z]+)*")
OTHERS_PACKAGES = {"usb_cam", "rqt_reconfigure", "dynamic_reconfigure"}  # named by a page, not ours to bring


def problem_of(command: Command) -> str:
    """What is wrong with a command as it stands, "" where nothing is."""
    words = [word for word in command.words if word != "&&"]
    check = _CHECKS.get(words[0], _check_script)
    return check([_without_brackets(word) for word in words])


def _without_brackets(word: str) -> str:
    """Of a synopsis, `[--room` becomes `--room`."""
    return word.strip("[]") if word.startswith("[") or word.endswith("]") else word


def _is_placeholder(word: str) -> bool:
    return bool(PLACEHOLDER.fullmatch(word.split(".")[0].rstrip("]")))


# --- roslaunch, rosrun


def _check_roslaunch(words: list[str]) -> str:
    try:
        package, name, *arguments = launched(words)
        path = launch_file(words)
    except rospkg.ResourceNotFound:
        return f"there is no package {package}"
    if not path.is_file():
        return f"{package} has no {name}"
    given = dict(argument.split(":=", 1) for argument in arguments if ":=" in argument)
    known = launch_arguments(path)
    unknown = [f"{name}:=" for name in given if name not in known]
    if unknown:
        return f"{name} has no argument {', '.join(unknown)}"
    plain = [argument for argument in arguments if not argument.startswith("-")]
    return _load_problem(path, plain) if not any(_is_placeholder(value) for value in given.values()) else ""


def launch_file(words: list[str]) -> Path:
    """That of a roslaunch command."""
    package, name, *_ = launched(words)
    return Path(rospkg.RosPack().get_path(package), "launch", name)


def launched(words: list[str]) -> list[str]:
    """Package, file and arguments of a roslaunch command, without its options."""
    port = words.index("-p") + 1 if "-p" in words else 0
    return [word for k, word in enumerate(words[1:], 1) if k != port and not word.startswith("-")]


@functools.lru_cache
def launch_arguments(path: Path) -> frozenset[str]:
    """Of a launch file, and of those that it passes all of its own on to."""
    names = set(roslaunch.arg_dump.get_args([str(path)]))
    text = path.read_text(encoding="utf-8")
    for package, name in re.findall(r'file="\$\(find (\w+)\)/launch/(\w+\.launch)" pass_all_args="true"', text):
        if name != path.name:  # it includes itself in a namespace
            names |= launch_arguments(Path(rospkg.RosPack().get_path(package), "launch", name))
    return frozenset(names)


def _load_problem(path: Path, arguments: list[str]) -> str:
    config = roslaunch.config.ROSLaunchConfig()
    try:
        roslaunch.xmlloader.XmlLoader(resolve_anon=True).load(str(path), config, argv=arguments, verbose=False)
    except Exception as err:  # roslaunch raises what it likes
        return f"roslaunch does not load it: {err}"
    return ""


def _check_rosrun(words: list[str]) -> str:
    package, program, *rest = words[1:]
    if package in OTHERS_PACKAGES:
        return ""
    if not roslib.packages.find_node(package, program):
        return f"{package} has no program {program}"
    if not (ROOT / "nodes" / program).exists() or package != "rosbot_patrol":
        return ""
    text = _sources(program)
    if "argparse" not in text:
        return ""
    options = {word.split("=")[0] for word in rest if word.startswith("--")}
    unknown = sorted(option for option in options if not _names(text, option))
    if unknown:
        return f"{program} has no option {', '.join(unknown)}"
    verb = next((word for word in rest[:1] if word.isidentifier() and word.islower()), "")
    if "add_subparsers" in text and verb and f'"{verb}"' not in text:
        return f"{program} has no '{verb}'"
    return ""


def _names(text: str, option: str) -> bool:
    """As a word, or by the field that an option is made from."""
    return f'"{option}"' in text or f'"{option[2:].replace("-", "_")}"' in text


@functools.lru_cache
def _sources(program: str) -> str:
    """Text of a program's module and of those of ours that it imports."""
    main = (ROOT / "nodes" / program).read_text(encoding="utf-8")
    own = "".join(map(_source, _imports(main)))
    return own + "".join(map(_source, _imports(own)))


def _imports(text: str) -> list[str]:
    return re.findall(r"^from (rosbot_patrol[\w.]*) import", text, flags=re.MULTILINE)


def _source(module: str) -> str:
    path = ROOT / "src" / f"{module.replace('.', '/')}.py"
    return path.read_text(encoding="utf-8") if path.is_file() else ""


# --- rosservice, rostopic, rosbag


def _check_rosservice(words: list[str]) -> str:
    verb, name, *arguments = words[1:]
    if verb != "call":
        return f"rosservice {verb} is not checked here"
    request = _service_request(name)
    if request is None:
        return f"no program of ours offers {name}"
    return _fill_problem(request, [yaml.safe_load(argument or "''") for argument in arguments])


def _service_request(name: str) -> Any:
    kind = _services().get(name.rsplit("/", 1)[-1])
    for package in SERVICE_PACKAGES if kind else ():
        found = roslib.message.get_service_class(f"{package}/{kind}")
        if found is not None:
            return found._request_class()
    return None


@functools.lru_cache
def _services() -> dict[str, str]:
    """Type of each service by the end of its name, as the nodes advertise them."""
    found = {}
    offer = re.compile(r'\b(?:rospy\.|Caller)Service\(\s*f?"([^"]+)",\s*(\w+)')
    for path in (ROOT / "src/rosbot_patrol/ros").rglob("*.py"):
        for name, kind in offer.findall(path.read_text(encoding="utf-8")):
            found[name.rsplit("/", 1)[-1].lstrip("~")] = kind.removesuffix("Fast")
    return found


def _check_rostopic(words: list[str]) -> str:
    verb, *rest = words[1:]
    rest = [word for word in rest if not word.startswith("-")]
    if not rest:
        return ""  # the program as such is spoken of
    if verb == "echo":
        return "" if len(rest) == 1 else f"rostopic echo wants one topic, not {rest}"
    if verb != "pub" or len(rest) < 2:
        return "rostopic wants: pub TOPIC TYPE [YAML], or echo TOPIC"
    _, kind, *arguments = rest
    message = roslib.message.get_message_class(kind)
    if message is None:
        return f"there is no message {kind}"
    return _fill_problem(message(), [yaml.safe_load(argument) for argument in arguments])


def _fill_problem(message: Any, arguments: list[Any]) -> str:
    """As rosservice and rostopic put YAML into a message."""
    if len(arguments) == 1 and isinstance(arguments[0], list):
        arguments = arguments[0]
    try:
        keys = {"now": genpy.Time(), "auto": genpy.Time()}
        genpy.message.fill_message_args(message, arguments, keys=keys)
        message.serialize(io.BytesIO())
    except (genpy.MessageException, genpy.SerializationError, ValueError, TypeError, AttributeError) as err:
        return f"the arguments do not fit {type(message)._type}: {err}"
    return ""


def _check_rosbag(words: list[str]) -> str:
    return "" if words[1] in ROSBAG_VERBS else f"rosbag has no '{words[1]}'"


# --- files


def _check_script(words: list[str]) -> str:
    path = ROOT / words[0]
    if words[0].startswith(".ws/"):
        return ""  # made by the command before
    if not os.access(path, os.X_OK):
        return f"{words[0]} is no program of the repository"
    text = path.read_text(encoding="utf-8")
    for word in words[1:]:
        name, is_argument, value = word.partition(":=")
        if is_argument and not _is_patrol_argument(name, text):
            return f"{words[0]} takes no {name}:="
        if word.startswith("--") and word not in text:
            return f"{words[0]} has no option {word}"
        if problem := _file_problem(value or word):
            return problem
    return ""


def _is_patrol_argument(name: str, text: str) -> bool:
    launches = ("demo.launch", "rosbot_patrol.launch", "scenario.launch")
    return f"{name}:=" in text or any(name in launch_arguments(ROOT / "launch" / launch) for launch in launches)


def _file_problem(word: str) -> str:
    """Of a word that names a place in the repository."""
    top = word.split("/", 1)[0]
    if "/" not in word or not (ROOT / top).is_dir() or not top or any(map(_is_placeholder, re.split(r"[/_]", word))):
        return ""
    return "" if (ROOT / word).exists() else f"there is no {word}"


def _check_files(words: list[str]) -> str:
    return next(filter(None, map(_file_problem, words[1:])), "")


def _check_make(words: list[str]) -> str:
    folder = ROOT / words[words.index("-C") + 1]
    makefile = folder / "Makefile"
    if not makefile.is_file():
        return f"there is no {makefile.relative_to(ROOT)}"
    rules = set(re.findall(r"^([\w./-]+):", makefile.read_text(encoding="utf-8"), flags=re.MULTILINE))
    targets = [word for word in words[3:] if word.isalpha()]
    unknown = [target for target in targets if target not in rules]
    return f"{makefile.relative_to(ROOT)} has no rule {', '.join(unknown)}" if unknown else ""


def _check_python(words: list[str]) -> str:
    if words[0] != ".ws/venv/bin/python" and not words[1].startswith("benchmarks/"):  # those find their interpreter
        return f"a shell of scripts/env has no {words[0]} that knows our packages: .ws/venv/bin/python has"
    if words[1:2] == ["-m"] and words[2].startswith("rosbot_patrol."):
        return "" if (ROOT / "src" / f"{words[2].replace('.', '/')}.py").is_file() else f"there is no module {words[2]}"
    return _check_files(words)


def _check_nothing(_: list[str]) -> str:
    return ""


_CHECKS: dict[str, Callable[[list[str]], str]] = {
    "roslaunch": _check_roslaunch,
    "rosrun": _check_rosrun,
    "rosservice": _check_rosservice,
    "rostopic": _check_rostopic,
    "rosbag": _check_rosbag,
    "make": _check_make,
    ".": _check_files,
    "cd": _check_files,
    "cp": _check_files,
    **dict.fromkeys(("python", "python3", "pytest", ".ws/venv/bin/python"), _check_python),
    **dict.fromkeys(
        ("export", "rosnode", "roscore", "rosparam", "rviz", "rqt_image_view", "arduino-cli", "catkin_make"),
        _check_nothing,
    ),
}
