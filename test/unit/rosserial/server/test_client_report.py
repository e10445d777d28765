"""What /diagnostics is told of clients: faults first, and bounded whatever number there is."""

from rosbot_patrol.rosserial.protocol.packet import encode
from rosbot_patrol.rosserial.protocol.proof import VERSION, Prover
from rosbot_patrol.rosserial.protocol.topics import ESP_TRIGGER_MD5, TopicId, TopicInfo, pack_topic_info
from rosbot_patrol.rosserial.server.client import Client
from rosbot_patrol.rosserial.server.policy import Policy
from rosbot_patrol.rosserial.server.report import MOST, Level, choose, look_at
from rosbot_patrol.rosserial.server.session import Session

ESP = TopicInfo(topic_id=125, name="motion_trigger", message_type="rosbot_patrol/EspTrigger", md5=ESP_TRIGGER_MD5)
ANNOUNCE = encode(TopicId.PUBLISHER, pack_topic_info(ESP))
KEY = bytes(range(32))


def client(number, policy=None, announces=True, **options):
    it = Client(None, Session(policy or Policy(), 0.0, **options), f"10.0.0.{number}:5", f"10.0.0.{number}")
    if announces:
        it.session.receive(ANNOUNCE + encode(125, bytes((number % 256, 0))), 0.0)
        it.note_message(ESP_TRIGGER_MD5, bytes((number % 256, 0)))
    return it


def test_a_sensor_that_is_well():
    state = look_at(client(7), 0.5)
    assert (state.level, state.text) == (Level.OK, "in sync")
    assert state.values["sensor"] == 7
    assert state.values["proven"] == "no key needed"
    assert state.values["messages"] == 1
    assert state.line == "sensor 7, no key needed, in sync, 1 messages, 0 dropped, 0.5 s ago"


def test_what_is_wrong_with_a_client():
    assert look_at(client(1), 6.0).text == "no sync with device"
    assert look_at(client(1, announces=False), 1.0).text == "no topic accepted"
    keyed = client(1, Policy(keys={1: KEY}), announces=False, nonce=bytes(32))
    assert look_at(keyed, 1.0).text == "has not proved itself"
    assert look_at(keyed, 1.0).values["proven"] == "no"
    keyed.session.receive(Prover(1, KEY, VERSION).answer(b"\x01" + bytes(32)), 1.0)
    keyed.session.receive(ANNOUNCE, 1.0)
    assert look_at(keyed, 1.0).level is Level.OK
    assert look_at(keyed, 1.0).values["proven"] == "yes"
    keyed.note_refusal("what it says for sensor 7: it has proved to be sensor 1", 1.0)
    keyed.session.last_frame = 30.0
    assert look_at(keyed, 30.0).text.startswith("was refused what it says for sensor 7")
    keyed.session.last_frame = 62.0
    assert look_at(keyed, 62.0).level is Level.OK
    assert look_at(keyed, 62.0).values["refused"] == 1


def test_five_hundred_clients_are_few_entries_with_the_faults_first():
    clients = [client(number) for number in range(500)]
    for late in (99, 300):
        clients[late].session.last_frame = -10.0
    in_full, others = choose(clients, 1.0)
    assert len(in_full) == MOST
    assert len(others) == 500 - MOST
    assert [state.peer for state in in_full[:2]] == ["10.0.0.99:5", "10.0.0.300:5"]
    assert all(state.level is Level.OK for state in others)
    assert max(len(state.line) for state in others) < 100
