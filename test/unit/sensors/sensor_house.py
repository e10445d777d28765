"""A house of sensors on one bridge, for the tests of the supervision: time goes in steps of 0.25 s."""

from rosbot_patrol.sensors.problems import Link
from rosbot_patrol.sensors.sensor_file import SensorList, SensorSpec
from rosbot_patrol.sensors.settings import WatchTimes
from rosbot_patrol.sensors.supervisor import Supervisor

ROOMS = {0: "base", **{i: f"place {i}" for i in range(1, 21)}}
STEP = 0.25


class Speaker:
    """A sensor: `beat` [s] between heartbeats, None: it says nothing; the level of its motion is sent with each."""

    def __init__(self, sensor_id, peer="", bridge="/esp_client1"):
        self.id, self.bridge = sensor_id, bridge
        self.peer = peer or f"10.0.0.{sensor_id}:5000"
        self.beat, self.move, self.clock, self.heard = 0.5, False, None, float("-inf")


class House:
    def __init__(self, *ids, listed=True, specs=(), **times):
        found = [*specs, *(SensorSpec(id=i, room=i) for i in ids)]
        self.now = 1000.0
        self.sensors = SensorList(found if listed else None, ROOMS, "sensors.yaml")
        self.watch = Supervisor(self.sensors, WatchTimes(**times), self.now)
        self.speakers = [Speaker(i) for i in ids]
        self.bridges = {"/esp_client1"}
        self.events = []

    def speaker(self, sensor_id):
        return next(s for s in self.speakers if s.id == sensor_id)

    def run(self, seconds):
        """Let time pass; returns what was told meanwhile as (kind, id or bridge, active)."""
        begin = len(self.events)
        for _ in range(round(seconds / STEP)):
            self.now += STEP
            for s in self.speakers:
                if s.beat is not None and s.bridge in self.bridges and self.now - s.heard >= s.beat:
                    s.heard = self.now
                    self.watch.heard(s.id, s.bridge, self.now, move=s.move)
            if self.now % 1.0 == 0.0:
                for bridge in self.bridges:
                    self.watch.linked(bridge, self.links(bridge), self.now)
            self.events += self.watch.tick(self.now)
        return [brief(event) for event in self.events[begin:]]

    def links(self, bridge):
        return [
            Link(sensor_id=s.id, peer=s.peer, heard=self.now - s.heard, clock_offset=s.clock)
            for s in self.speakers
            if s.bridge == bridge and self.now - s.heard < 15.0
        ]

    def wrong(self):
        return sorted(map(str, self.watch.problems()))


def brief(event):
    key = event.problem.key
    return key.kind_name, key.bridge or key.sensor_id, event.active
