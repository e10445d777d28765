"""A patrol in the small world of the patrol's own tests, as messages of a bag.

PYTHONPATH=src .ws/venv/bin/python test/unit/replay/made_patrol.py test/replay/patrol.bag    # the bag of the repo
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from belief_pictures import good_network
from made_bag import NOETIC, Maker, write_bag
from rosbags.typesys import get_types_from_msg

from rosbot_patrol import params
from rosbot_patrol.geometry import Pose2D
from rosbot_patrol.goal import GoalState
from rosbot_patrol.patrol.mission.manager import PatrolManager
from rosbot_patrol.patrol.mission.params import NodeParams
from rosbot_patrol.patrol.search.room_search import RoomSearch

ROOT = Path(__file__).resolve().parents[3]

from patrol_world import ROOMS, World  # noqa: E402
from patrol_world import looking as looking  # noqa: E402

BOXES, COUNT = "darknet_ros_msgs/msg/BoundingBoxes", "darknet_ros_msgs/msg/ObjectCount"
GOAL, OUTCOME = "move_base_msgs/msg/MoveBaseActionGoal", "move_base_msgs/msg/MoveBaseActionResult"
TRIGGER = "rosbot_patrol/msg/EspTrigger"
OWN = {
    TRIGGER: ROOT / "msg" / "EspTrigger.msg",
    "darknet_ros_msgs/msg/BoundingBox": ROOT / "drop_in" / "darknet_ros_msgs" / "msg" / "BoundingBox.msg",
    BOXES: ROOT / "drop_in" / "darknet_ros_msgs" / "msg" / "BoundingBoxes.msg",
    COUNT: ROOT / "drop_in" / "darknet_ros_msgs" / "msg" / "ObjectCount.msg",
}
ACTION = {
    "move_base_msgs/msg/MoveBaseGoal": "geometry_msgs/PoseStamped target_pose\n",
    "move_base_msgs/msg/MoveBaseResult": "",
    GOAL: "std_msgs/Header header\nactionlib_msgs/GoalID goal_id\nmove_base_msgs/MoveBaseGoal goal\n",
    OUTCOME: "std_msgs/Header header\nactionlib_msgs/GoalStatus status\nmove_base_msgs/MoveBaseResult result\n",
}
for _name, _text in ({name: path.read_text() for name, path in OWN.items()} | ACTION).items():
    if _name not in NOETIC.types:
        _spelled = re.sub(r"^Header ", "std_msgs/Header ", _text, flags=re.MULTILINE)
        NOETIC.register(get_types_from_msg(_spelled or "# nothing\n", _name))

POINTS = "rooms_num: 4\nangle_unit: rad\nrooms:\n" + "".join(
    f"  room{room.id}: {{name: {room.name}, x: {room.pose.x}, y: 0.0, angle: 0.0}}\n" for room in ROOMS
)
NODE = params.load(NodeParams, {"path_to_params": "rooms.yaml", "look_around": "spin"})


def goal_message(make: Maker, stamp: float, name: str, pose: Pose2D) -> Any:
    """A MoveBaseActionGoal."""
    place = make.new("geometry_msgs/msg/PoseStamped", make.header(stamp, "map"), make.pose(pose))
    goal = make.new("move_base_msgs/msg/MoveBaseGoal", place)
    name_of = make.new("actionlib_msgs/msg/GoalID", make.stamp(stamp), name)
    return make.new(GOAL, make.header(stamp, ""), name_of, goal)


def result_message(make: Maker, stamp: float, name: str, status: int, text: str) -> Any:
    """A MoveBaseActionResult."""
    name_of = make.new("actionlib_msgs/msg/GoalID", make.stamp(stamp), name)
    result = make.new("move_base_msgs/msg/MoveBaseResult")
    told = make.new("actionlib_msgs/msg/GoalStatus", name_of, status, text)
    return make.new(OUTCOME, make.header(stamp, ""), told, result)


class RecordedWorld(World):
    """The world, and what rosbag would have written of it."""

    def __init__(self, **given: Any) -> None:
        views = RoomSearch(NODE)
        super().__init__(
            PatrolManager(ROOMS, network=good_network, views=views, viewpoints=views.fallback_viewpoints), **given
        )
        self._make = Maker()
        self.messages: list[tuple[float, str, Any]] = []
        self._ended = 0
        self._put(0.0, "/tf_static", self._make.tf(self._make.planar("map", "odom", self.now, Pose2D())))

    def _put(self, late: float, topic: str, message: Any) -> None:
        self.messages.append((self.now + late, topic, message))

    def step(self) -> Any:
        make, now = self._make, self.now
        self._put(-0.006, "/tf", make.tf(make.planar("odom", "base_link", now, Pose2D(self.x, 0.0, self.yaw))))
        for room in self.triggers:
            self._put(-0.005, "/motion_trigger", make.new(TRIGGER, room, True))
        tick = round(now * 25)
        if tick % 5 == 0 and self.link.is_up:
            statuses = make.new("actionlib_msgs/msg/GoalStatusArray", make.header(now, ""), [])
            self._put(-0.004, "/move_base/status", statuses)
        if tick % 3 == 0 and self.detector:
            self._see(now)
        was = self.link.state
        out = super().step()
        if out.goal is not None:
            goal = goal_message(make, now, f"goal-{len(self.goals)}", out.goal.pose)
            self.messages.append((now + 0.001, "/move_base/goal", goal))
        has_ended = self.link.state in (GoalState.SUCCEEDED, GoalState.FAILED)
        if has_ended and (out.goal is not None or was is GoalState.ACTIVE):
            self._end(now)
        return out

    def _see(self, now: float) -> None:
        make = self._make
        picture = make.header(now - 0.05, "camera")
        count = 1 if self.person_when(self) else 0
        if count:
            box = make.new("darknet_ros_msgs/msg/BoundingBox", 0.9, 10, 10, 60, 200, 0, "person")
            self._put(-0.003, "/darknet_ros/bounding_boxes", make.new(BOXES, picture, picture, [box]))
        self._put(-0.002, "/darknet_ros/found_object", make.new(COUNT, picture, count))

    def _end(self, now: float) -> None:
        status = 3 if self.link.state is GoalState.SUCCEEDED else 4
        ended = result_message(self._make, now, f"goal-{len(self.goals)}", status, self.link.text)
        self.messages.append((now + 0.002, "/move_base/result", ended))


if __name__ == "__main__":
    house = RecordedWorld(person_when=lambda world: looking(world) and world.x > 19.0)
    for _ in range(25):
        house.step()
    house.mission(2)
    house.mission(1, count=2)
    for _ in range(25):
        house.step()
    path = Path(sys.argv[1])
    path.unlink(missing_ok=True)
    messages = sorted(house.messages, key=lambda each: each[0])
    write_bag(path, messages, compression="BZ2", latching=["/tf_static"])
    path.with_name(f"{path.stem}_rooms.yaml").write_text(POINTS)
    print(path, path.stat().st_size, "bytes", [mission.verdict for mission in house.ended])
