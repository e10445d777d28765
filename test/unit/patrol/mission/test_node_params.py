"""The patrol node's parameters reach what they are for."""

import dataclasses

from rosbot_patrol.params import load
from rosbot_patrol.patrol.mission.params import NodeParams
from rosbot_patrol.patrol.search.room_search import RoomSearch
from rosbot_patrol.patrol.search.survey import SightParams

SET = {
    "path_to_params": "points.yaml",
    "look_around": "spin",
    "person_distance": 0.7,
    "clear_share": 0.25,
}


def test_the_node_knows_each_parameter_of_how_a_room_is_looked_at():
    node = load(NodeParams, SET, name="~")
    params = RoomSearch(node).params
    assert {field.name for field in dataclasses.fields(SightParams)} <= {f.name for f in dataclasses.fields(params)}
    assert (params.look_around, params.person_distance, params.clear_share) == ("spin", 0.7, 0.25)
