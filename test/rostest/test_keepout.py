"""A keep-out mask from a file, or zones: plans go round them; without the mask the node ends in a sentence."""

import subprocess

import numpy as np
import pytest
import yaml

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

from move_base_bench import parameters, start_move_base

ASK = (
    "{start: {header: {frame_id: map}, pose: {orientation: {w: 1.0}}}, "
    "goal: {header: {frame_id: map}, pose: {position: {x: 3.0}, orientation: {w: 1.0}}}, tolerance: 0.1}"
)


def mask(folder):
    """A strip across the way from (0, 0) to (3, 0): x 1.0 to 1.6 m, y -1.0 to 1.0 m."""
    cells = np.full((40, 12), 0, np.uint8)
    (folder / "keepout.pgm").write_bytes(b"P5\n12 40\n255\n" + cells.tobytes())
    keys = {"image": "keepout.pgm", "resolution": 0.05, "origin": [1.0, -1.0, 0.0], "negate": 0}
    (folder / "keepout.yaml").write_text(yaml.dump(keys | {"occupied_thresh": 0.65, "free_thresh": 0.196}))
    return folder / "keepout.yaml"


def with_mask(file):
    """The tuned global costmap with the layer."""
    costmap = parameters()["global_costmap"]
    plugins = list(costmap["plugins"])
    plugins.insert(1, {"name": "keepout_layer", "type": "rosbot_patrol/KeepoutLayer"})
    return costmap | {"plugins": plugins, "keepout_layer": {"mask_file": str(file)}}


def zones(folder):
    """The same strip as a zone that an owner has drawn."""
    corners = [[1.0, -1.0], [1.6, -1.0], [1.6, 1.0], [1.0, 1.0]]
    (folder / "zones.yaml").write_text(yaml.dump({"zones": [{"name": "strip", "points": corners}]}))
    return folder / "zones.yaml"


@pytest.mark.parametrize("kind", ["mask", "zones"])
def test_plans_go_round_it(master, tmp_path, kind):
    if kind == "mask":
        node, _, _ = start_move_base(master, global_costmap=with_mask(mask(tmp_path)))
        node.says("keep-out mask of 12 x 40 cells", 5.0)
    else:
        node, _, _ = start_move_base(master, zones_file=str(zones(tmp_path)))
        node.says("global_costmap: keep-out zones: strip", 5.0)
    told = subprocess.run(
        ["rosservice", "call", "/move_base/make_plan", ASK], env=master.env, capture_output=True, text=True, check=True
    ).stdout
    poses = yaml.safe_load(told)["plan"]["poses"]
    points = np.array([[p["pose"]["position"][k] for k in "xy"] for p in poses])
    assert len(points) > 50
    inside = (points[:, 0] > 0.9) & (points[:, 0] < 1.7) & (np.abs(points[:, 1]) < 1.1)
    assert not inside.any()
    master.stop_nodes()


def test_a_mask_that_is_missing_is_one_sentence(master, tmp_path):
    tree = parameters() | {"global_costmap": with_mask(tmp_path / "none.yaml")}
    subprocess.run(
        ["rosparam", "load", "-", "/move_base"], env=master.env, input=yaml.dump(tree), text=True, check=True
    )
    node = master.node("move_base")
    assert node.popen.wait(20.0) == 1
    assert "none.yaml: the map's yaml cannot be read" in node.output
    assert "Traceback" not in node.output
