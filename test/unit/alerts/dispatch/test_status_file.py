import json

import pytest

from rosbot_patrol.alerts.dispatch.delivery import ChannelStatus
from rosbot_patrol.alerts.dispatch.status_file import NAME, read_status, write_status

MAIL = ChannelStatus(
    name="mail",
    describe="a box",
    waiting=1,
    since=5.0,
    refused=0,
    down_for=2.0,
    error="no network",
    next_try=3.0,
    refusal="",
)


def test_it_reads_back(tmp_path):
    assert read_status(tmp_path) is None
    write_status(tmp_path, wall=7.0, who="/patrolling_node (process 1)", channels=[MAIL])
    status = read_status(tmp_path)
    assert (status.wall, status.who, status.channels) == (7.0, "/patrolling_node (process 1)", (MAIL,))


def test_a_key_that_a_later_version_added_is_left_out(tmp_path):
    write_status(tmp_path, wall=7.0, who="a", channels=[MAIL])
    tree = json.loads((tmp_path / NAME).read_bytes())
    tree["channels"][0]["later"] = tree["later"] = 1
    (tmp_path / NAME).write_text(json.dumps(tree))
    assert read_status(tmp_path).channels == (MAIL,)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"wall": 1, "who": "a", "channels": [3]}', '{"wall": "x"}'])
def test_what_makes_no_sense_is_no_state(tmp_path, text):
    (tmp_path / NAME).write_text(text)
    assert read_status(tmp_path) is None
