"""Our tf without ROS against tf2 itself, over random trees and drives."""

import math

import numpy as np
import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3

from rosbot_patrol.errors import TransformError
from rosbot_patrol.tf.tree import Edge, TransformTree

FRAMES = ["map", "odom", "base_footprint", "base_link", "laser", "camera"]
TICK = 1.0 / 64.0  # times that a float and nanoseconds both hold exactly


def message_of(edge):
    found = TransformStamped(child_frame_id=edge.child)
    found.header.frame_id, found.header.stamp = edge.parent, rospy.Time.from_sec(edge.stamp)
    found.transform.translation = Vector3(edge.x, edge.y, edge.z)
    found.transform.rotation = Quaternion(edge.qx, edge.qy, edge.qz, edge.qw)
    return found


def random_edge(rng, parent, child, stamp):
    turn = rng.normal(size=4)
    return Edge(parent, child, stamp, *rng.normal(size=3), *(turn / np.linalg.norm(turn)))


def as_tf2_says(buffer, target, source, stamp):
    try:
        when = rospy.Time(0) if stamp is None else rospy.Time.from_sec(stamp)
        found = buffer.lookup_transform_core(target, source, when).transform
    except tf2_ros.TransformException:
        return None
    t, q = found.translation, found.rotation
    return np.array([t.x, t.y, t.z, q.x, q.y, q.z, q.w])


def as_ours_says(tree, target, source, stamp):
    try:
        return np.array(tree.transform(target, source, stamp))
    except TransformError:
        return None


@pytest.mark.parametrize("seed", range(6))
def test_every_look_up_is_tf2s(seed):
    rng = np.random.default_rng(seed)
    tree, buffer = TransformTree(5.0), tf2_ros.BufferCore(rospy.Duration(5.0))
    now, agreed, failed = 100.0, 0, 0
    for step in range(400):
        now += TICK * int(rng.integers(0, 20))
        child = int(rng.integers(1, len(FRAMES)))
        late = TICK * int(rng.integers(-30, 30)) if rng.random() < 0.3 else 0.0
        parent = FRAMES[max(child - int(rng.integers(1, 3)), 0)] if rng.random() < 0.05 else FRAMES[child - 1]
        edge = random_edge(rng, parent, FRAMES[child], now + late)
        is_static = child >= 4 and seed % 2 == 0
        tree.add(edge, is_static=is_static)
        buffer.set_transform(message_of(edge), "test") if not is_static else buffer.set_transform_static(
            message_of(edge), "test"
        )
        if step < 20:
            continue
        target, source = (FRAMES[int(i)] for i in rng.integers(0, len(FRAMES), 2))
        stamp = None if rng.random() < 0.2 else now - TICK * int(rng.integers(-20, 500)) * float(rng.random() < 0.9)
        theirs, ours = as_tf2_says(buffer, target, source, stamp), as_ours_says(tree, target, source, stamp)
        assert (theirs is None) == (ours is None), (step, target, source, stamp)
        if theirs is None:
            failed += 1
            continue
        agreed += 1
        np.testing.assert_allclose(ours[:3], theirs[:3], atol=1e-6)
        turned = abs(float(np.dot(ours[3:], theirs[3:])))
        assert math.isclose(turned, 1.0, abs_tol=1e-9)
    assert agreed > 100
    assert failed > 20
