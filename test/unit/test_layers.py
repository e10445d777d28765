"""Which way imports go (docs/architecture.md), and that only rosbot_patrol.ros knows ROS."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SRC = ROOT / "src" / "rosbot_patrol"

# Rows from the bottom up: a module may import from rows below its own, and from its own package.
ROWS: list[set[str]] = [
    {"errors", "counts"},
    {"params", "files", "yaml_files"},
    {"kernels", "tunable", "package_files"},
    {"geometry", "graph"},
    {"host"},
    {"grid", "scan", "goal"},
    {"maps", "images", "tf", "scan_line", "scan_check"},
    {"costmap", "scan_feed"},
    {"planning", "amcl", "gmapping", "exploration", "detection", "rosserial", "control", "ekf"},
    {"drivers"},
    {"navigation", "patrol", "alerts", "sensors", "simulation"},
    {"closed_loop", "campaign", "console"},
    {"replay"},
    {"ros"},
]
ROW_OF = {name: i for i, row in enumerate(ROWS) for name in row}
# The same inside a package, for its sub-packages and modules.
ROWS_INSIDE: dict[str, list[set[str]]] = {
    "alerts": [
        {"safe_text", "disk_reserve"},
        {"records"},
        {"pictures", "report"},
        {"outbox"},
        {"channels"},
        {"dispatch"},
    ],
    "simulation": [
        {"noise", "meshes", "devices", "start_place", "plans"},
        {"scene"},
        {"sensors", "actors"},
        {"robot", "sdf"},
        {"physics"},
        {"population", "render"},
        {"scenario"},
        {"engine"},
        {"player", "hardware"},
    ],
    "patrol": [
        {"house"},
        {"records"},
        {"calls", "guard", "visibility"},
        {"intruder"},
        {"belief"},
        {"search", "story", "senses"},
        {"mission"},
    ],
    "console": [
        {"words"},
        {"told"},
        {"access", "house"},
        {"live"},
        {"sentences", "home_assistant"},
        {"pages"},
        {"web"},
    ],
    "rosserial": [{"protocol"}, {"server", "device"}],
    "ros": [
        {"runtime", "messages", "models"},
        {
            "amcl",
            "maps",
            "move_base",
            "drive",
            "detector",
            "bridge",
            "post",
            "simulator",
            "campaign",
            "drivers",
            "console",
        },
        {"patrol", "sensors"},
        {"gmapping"},
        {"tools"},
    ],
}
SIDEWAYS = {
    ("patrol", "alerts"),  # a mission hands an incident over
    ("patrol", "sensors"),
}
ROS_MODULES = {
    "rospy",
    "tf",
    "tf2_ros",
    "actionlib",
    "cv_bridge",
    "genpy",
    "roslib",
    "rosgraph",
    "rospkg",
    "rosbag",
    "message_filters",
}


_INSIDE = {f"rosbot_patrol.{path.name}" for path in SRC.iterdir() if path.is_dir()}


def modules() -> list[Path]:
    return sorted(SRC.rglob("*.py"))


def package_of(path: Path) -> str:
    parts = path.relative_to(SRC).parts
    return parts[0] if len(parts) > 1 else path.stem


def imports(path: Path) -> list[tuple[str, int, bool]]:
    """(dotted name, line, whether at the module's top level)."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    inside = {
        id(child)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for child in ast.walk(node)
    }
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [(alias.name, node.lineno, id(node) not in inside) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
            if node.module == "rosbot_patrol" or node.module in _INSIDE:
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            found += [(name, node.lineno, id(node) not in inside) for name in names]
    return found


@pytest.mark.parametrize("path", modules(), ids=lambda p: str(p.relative_to(SRC)))
def test_imports_go_down_only(path: Path) -> None:
    own = package_of(path)
    if own == "__init__":
        return
    assert own in ROW_OF, f"{own} has no row in docs/architecture.md and in this test"
    for name, line, _ in imports(path):
        if not name.startswith("rosbot_patrol."):
            continue
        other = name.split(".")[1]
        allowed = (
            other == own
            or ROW_OF.get(other, 99) < ROW_OF[own]
            or (own, other) in SIDEWAYS
            or (own == "ros" and other in {"msg", "srv", "action", "cfg"})
        )
        assert allowed, f"{path.relative_to(ROOT)}:{line} imports {name}: up or sideways"


def test_no_circle_inside_a_package() -> None:
    """Among the sub-packages and modules of a package, whatever rows it has or not."""
    ways: dict[str, set[str]] = {}
    for path in modules():
        own = _part(path.relative_to(SRC).with_suffix("").parts)
        for name, _, _ in imports(path):
            other = _part(tuple(name.split(".")[1:])) if name.startswith("rosbot_patrol.") else ""
            if other != own and other.split("/")[0] == own.split("/")[0]:
                ways.setdefault(own, set()).add(other)
    for part in ways:
        assert part not in _reached_from(part, ways), f"{part} imports what imports it"


def _part(dotted: tuple[str, ...]) -> str:
    return "/".join(dotted[:2])


def _reached_from(part: str, ways: dict[str, set[str]]) -> set[str]:
    found: set[str] = set()
    rest = list(ways.get(part, ()))
    while rest:
        if (here := rest.pop()) not in found:
            found.add(here)
            rest += ways.get(here, ())
    return found


@pytest.mark.parametrize("package", ROWS_INSIDE)
def test_imports_inside_a_package_go_down_only(package: str) -> None:
    row_of = {name: i for i, row in enumerate(ROWS_INSIDE[package]) for name in row}
    for path in sorted((SRC / package).rglob("*.py")):
        own = path.relative_to(SRC / package).parts[0].removesuffix(".py")
        if own == "__init__":
            continue
        assert own in row_of, f"{package}/{own} has no row in this test"
        for name, line, _ in imports(path):
            if not name.startswith(f"rosbot_patrol.{package}."):
                continue
            other = name.split(".")[2]
            allowed = other == own or row_of.get(other, 99) < row_of[own]
            assert allowed, f"{path.relative_to(ROOT)}:{line} imports {name}: up or sideways"


@pytest.mark.parametrize(
    "path", [p for p in modules() if package_of(p) != "ros"], ids=lambda p: str(p.relative_to(SRC))
)
def test_only_ros_knows_ros(path: Path) -> None:
    for name, line, _ in imports(path):
        top = name.split(".")[0]
        assert top not in ROS_MODULES, f"{path.relative_to(ROOT)}:{line} imports {name}"
        assert not top.endswith(("_msgs", "_srvs")), f"{path.relative_to(ROOT)}:{line} imports {name}"
        assert not name.startswith(("rosbot_patrol.msg", "rosbot_patrol.srv")), f"{path}:{line} imports {name}"


@pytest.mark.parametrize(
    "path", [p for p in modules() if package_of(p) != "ros"], ids=lambda p: str(p.relative_to(SRC))
)
def test_pure_code_has_no_clock(path: Path) -> None:
    if path.name == "kernels.py":
        return  # a program of the set-up: it reports how long it took
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            owner = node.func.value
            called = f"{owner.id}.{node.func.attr}" if isinstance(owner, ast.Name) else ""
            assert called not in {"time.sleep", "time.time"}, f"{path.relative_to(ROOT)}:{node.lineno} calls {called}"


def test_programs_are_thin() -> None:
    programs = list((ROOT / "nodes").iterdir()) + list((ROOT / "drop_in").glob("*/nodes/*"))
    assert programs
    for program in programs:
        lines = [line for line in program.read_text(encoding="utf-8").splitlines() if line.strip()]
        assert len(lines) <= 3, f"{program} has {len(lines)} lines: the work belongs in rosbot_patrol.ros"
        # catkin's relay in the devel space is the program; with a run bit here rosrun would find two and ask which.
        assert not program.stat().st_mode & 0o111, f"{program} has a run bit"
