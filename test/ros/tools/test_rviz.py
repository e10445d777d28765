"""rviz's displays listen where our nodes publish, each to the type that it can show."""

from pathlib import Path

import pytest
import yaml

pytest.importorskip("rospy", reason="ROS is not on the path: `. scripts/env` first")

from rosbot_patrol.ros.patrol.outputs import PEOPLE_TOPIC

ROOT = Path(__file__).resolve().parents[3]
ROS = ROOT / "src" / "rosbot_patrol" / "ros"
DISPLAYS = yaml.safe_load((ROOT / "rviz" / "rosbot_patrol.rviz").read_text())["Visualization Manager"]["Displays"]
# topic -> (rviz's display, where the code says what is published there)
MARKERS = {
    PEOPLE_TOPIC: ("patrol/outputs.py", "rospy.Publisher(PEOPLE_TOPIC, MarkerArray"),
    "house_markers/markers": ("tools/markers_node.py", 'rospy.Publisher("~markers", MarkerArray'),
    "explore/frontiers": ("gmapping/explore_node.py", 'rospy.Publisher("~frontiers", MarkerArray'),
    "mark_rooms/markers": ("tools/mark_rooms_node.py", 'rospy.Publisher("~markers", MarkerArray'),
}


def test_every_marker_that_our_nodes_publish_is_shown():
    shown = {d["Marker Topic"]: d for d in DISPLAYS if d["Class"] == "rviz/MarkerArray"}
    assert set(shown) == set(MARKERS)
    assert all(display["Enabled"] for display in shown.values())


@pytest.mark.parametrize("topic", MARKERS)
def test_the_topic_is_published_as_a_marker_array(topic):
    file, words = MARKERS[topic]
    assert words in (ROS / file).read_text()


def test_nobody_publishes_markers_that_rviz_does_not_show():
    publishing = {
        path.relative_to(ROS).as_posix()
        for path in ROS.rglob("*.py")
        if "MarkerArray, queue_size" in path.read_text() and "Publisher(" in path.read_text()
    }
    assert publishing == {file for file, _ in MARKERS.values()}


def test_names_are_used_once():
    names = [display["Name"] for display in DISPLAYS]
    assert len(names) == len(set(names))
