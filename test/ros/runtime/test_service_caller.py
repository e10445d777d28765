"""Calls of a device to a ROS service: whatever goes wrong with one, the next is answered. No master."""

import queue
import threading

import pytest

pytest.importorskip("rospy", reason="needs ROS: source the workspace first")

import genpy
import rospy
from rospy.exceptions import TransportTerminated
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from rosbot_patrol.errors import ProtocolError
from rosbot_patrol.ros.bridge import channels as serial_channels
from rosbot_patrol.ros.bridge.layouts import raw_from
from rosbot_patrol.ros.runtime.node import Worker
from rosbot_patrol.rosserial.protocol.topics import TopicInfo


class Caller:
    """A device's caller, whose service fails as it is told to once, and answers then."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.failures: queue.Queue[Exception] = queue.Queue()
        self.answers: queue.Queue[bytes] = queue.Queue()
        monkeypatch.setattr(rospy, "ServiceProxy", lambda *_: self._serve)
        self._info = info = TopicInfo(
            topic_id=100,
            name="/home/help",
            message_type="std_srvs/Trigger",
            md5=Trigger._response_class._md5sum,
            buffer_size=512,
        )
        self.caller = serial_channels.ServiceCaller(info, lambda _id, data: self.answers.put(data))
        self.caller.set_answer_topic(info)

    def _serve(self, _request: object) -> object:
        if not self.failures.empty():
            raise self.failures.get_nowait()
        return raw_from(TriggerResponse, serial_channels.serialize(TriggerResponse(True, "all is well")), self._info)


@pytest.fixture
def caller(monkeypatch: pytest.MonkeyPatch):
    made = Caller(monkeypatch)
    yield made
    made.caller.close()


FAILURES = [
    rospy.ServiceException("no such service"),
    TransportTerminated("unable to receive data"),
    genpy.SerializationError("field message must be a string"),
    ConnectionRefusedError(111, "the master is down"),
    ProtocolError("", "the device has gone"),
]


@pytest.mark.parametrize("failure", FAILURES, ids=lambda f: type(f).__name__)
def test_a_call_that_fails_does_not_end_the_next(caller: Caller, failure: Exception, caplog) -> None:
    caller.failures.put(failure)
    caller.caller.receive(serial_channels.serialize(TriggerRequest()))
    caller.caller.receive(serial_channels.serialize(TriggerRequest()))
    answer = TriggerResponse().deserialize(caller.answers.get(timeout=10.0))
    assert answer.message == "all is well"
    assert sum("service /home/help called by a device" in line for line in caplog.messages) == 1


def test_the_thread_is_one_that_ends_the_bridge_with_it(caller: Caller) -> None:
    names = [thread.name for thread in threading.enumerate() if isinstance(thread, Worker)]
    assert "calls /home/help" in names
