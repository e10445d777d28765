from pathlib import Path

from rosbot_patrol.rosserial.device.client_session import DeviceSession
from rosbot_patrol.rosserial.device.device_log import STUCK_AFTER, read_stuck_line, stuck_line
from rosbot_patrol.rosserial.server.policy import Policy
from rosbot_patrol.rosserial.server.session import Session
from rosbot_patrol.sensors.links import MAX_LINKS, Links
from rosbot_patrol.sensors.problems import Link

ROOT = Path(__file__).resolve().parents[3]


def plain(peer):
    return False, None


def test_messages_are_counted_by_sensor_and_connection():
    links = Links()
    assert links.heard(3, "10.0.0.3:5000", 10.0, move=False)
    assert not links.heard(3, "10.0.0.3:5000", 10.5, move=True)
    assert links.heard(4, "10.0.0.3:5000", 10.5, move=False)  # a gateway speaks for two
    assert links.heard(3, "10.0.0.9:77", 11.0, move=False)
    first = links.snapshot(12.0, lambda peer: (peer.endswith("5000"), 2.0))[0]
    assert first == Link(
        sensor_id=3, peer="10.0.0.3:5000", heard=1.5, messages=2, triggers=1, proven=True, clock_offset=2.0
    )
    assert links.closed("10.0.0.3:5000")
    assert not links.closed("10.0.0.3:5000")
    assert [link.peer for link in links.snapshot(12.0, plain)] == ["10.0.0.9:77"]


def test_who_speaks_for_ever_new_ids_is_bounded():
    links = Links()
    for i in range(3 * MAX_LINKS):
        links.heard(i % 256, f"peer{i}", float(i), move=False)
    assert len(links) == MAX_LINKS


def test_a_stuck_output_is_known_by_the_devices_log_until_it_reports_again():
    links = Links()
    links.heard(3, "a:1", 0.0, move=True)
    assert not links.logged("a:1", "sensor 4: its output has been high for 600 s")  # is not on this connection
    assert not links.logged("a:1", "sensor 99999999999: its output has been high for 600 s")
    assert links.logged("a:1", stuck_line(3, 601.2))
    assert not links.logged("a:1", stuck_line(3, 602.0))
    assert links.snapshot(1.0, plain)[0].is_stuck
    links.heard(3, "a:1", 2.0, move=False)
    assert links.snapshot(2.0, plain)[0].is_stuck
    links.heard(3, "a:1", 3.0, move=True)
    assert not links.snapshot(3.0, plain)[0].is_stuck


def test_the_firmware_writes_the_same_sentence():
    sketch = ROOT / "firmware" / "esp_motion_sensor"
    source = (sketch / "motion_sensor.cpp").read_text(encoding="utf-8")
    assert '"sensor %u: its output has been high for %lu s"' in source
    assert read_stuck_line("sensor 7: its output has been high for 600 s") == 7
    assert f"STUCK_MS {STUCK_AFTER * 1000:.0f}\n" in (sketch / "settings.h").read_text(encoding="utf-8")


def test_hosts_of_peers():
    peers = ["10.0.0.3:5000", "[fc94::7]:5000", "/dev/ttyUSB0", "[fe80::1%eth0]:5"]
    assert [Link(sensor_id=1, peer=p).host for p in peers] == ["10.0.0.3", "fc94::7", "/dev/ttyUSB0", "fe80::1%eth0"]


def test_a_device_that_says_what_time_it_is_is_compared_and_one_that_does_not_is_not():
    def talk(device, server, now, clock):
        for _ in range(3):
            for frame in server.take_output():
                device.receive(frame, now)
            for frame in device.take_output():
                for event in server.receive(frame, now):
                    if type(event).__name__ == "TimeAsked":
                        server.answer_time(int(clock), int(clock % 1.0 * 1e9))

    server, device = Session(Policy(), 0.0), DeviceSession([])
    talk(device, server, 0.0, 1_790_000_000.25)
    assert server.clock_offset is None  # upstream's client, and ours before the first answer, send zeros
    device.tick(3.0)
    talk(device, server, 3.0, 1_790_000_003.25)
    assert abs(server.clock_offset) < 0.01
    device.tick(6.0)
    talk(device, server, 6.0, 1_790_000_106.25)  # the bridge's clock was set: the device learns it with the answer
    assert abs(server.clock_offset + 100.0) < 0.01
    device.tick(9.0)
    talk(device, server, 9.0, 1_790_000_109.25)
    assert abs(server.clock_offset) < 0.01
