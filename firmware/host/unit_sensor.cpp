// The whole sensor with the test's own board, link and bridge, millisecond by millisecond.
#include <string.h>

#include <deque>

#include "motion_sensor.h"
#include "unit.h"

using patrol::LinkState;
using patrol::MotionSensor;
using unit::Bytes;

namespace {

struct FakeBoard final : patrol::Board {
  uint32_t raw = 0;
  bool cold = false;
  bool level = false;
  bool edge = false;
  uint32_t edge_at = 0;
  bool up = true;
  bool led = false;
  int joins = 0;
  uint32_t seed = 1;
  std::string lines;

  uint32_t milliseconds() override { return raw; }
  uint32_t random() override { return seed = seed * 1664525U + 1013904223U; }
  void fill(uint8_t* data, size_t size) override { memset(data, 0x22, size); }
  bool poweredOn() override { return cold; }
  bool motionLevel() override { return level; }
  bool takeEdge(uint32_t* at) override {
    *at = edge_at;
    const bool was = edge;
    edge = false;
    return was;
  }
  void setLed(bool on) override { led = on; }
  void log(const char* line) override { lines += std::string(line) + "\n"; }
  void feedWatchdog() override {}
  void joinNetwork() override { ++joins; }
  bool networkUp() override { return up; }

  void move(bool high) {
    if (high && !level) {
      edge = true;
      edge_at = raw;
    }
    level = high;
  }
};

/** The link, and the bridge at its other end. */
struct FakeBridge final : patrol::Link {
  bool reachable = true;   // connects succeed
  bool refuses = false;    // connects fail at once
  bool hears = true;       // data arrives in both directions
  bool takes = true;       // there is room to send
  bool answers = true;     // tells the time
  bool closes = false;     // closes the connection
  int opened = 0;
  LinkState state = LinkState::kClosed;
  patrol::FrameParser parser;
  std::deque<uint8_t> to_sensor;
  int trigger_count = 0;
  int heartbeat_count = 0;
  std::string logged;

  void dial() override {
    ++opened;
    state = LinkState::kConnecting;
    parser.clear();
    to_sensor.clear();
  }
  LinkState progress() override {
    if (state == LinkState::kConnecting && refuses) state = LinkState::kClosed;
    if (state == LinkState::kConnecting && reachable) {
      state = LinkState::kOpen;
      say(0, {});
    }
    return state;
  }
  int readSome(uint8_t* data, size_t room) override {
    if (closes) return -1;
    if (!hears) return 0;
    size_t count = 0;
    for (; count < room && !to_sensor.empty(); ++count) {
      data[count] = to_sensor.front();
      to_sensor.pop_front();
    }
    return static_cast<int>(count);
  }
  int writeSome(const uint8_t* data, size_t size) override {
    if (closes) return -1;
    if (!takes) return 0;
    if (hears) {
      for (size_t at = 0; at < size;) {
        at += parser.write(data + at, size - at);
        patrol::Frame frame;
        while (parser.next(&frame)) heard(frame);
      }
    }
    return static_cast<int>(size);
  }
  void hangUp() override { state = LinkState::kClosed; }
  const char* error() const override { return "refused"; }

  void heard(const patrol::Frame& frame) {
    const Bytes data(frame.data, frame.data + frame.size);
    if (frame.topic_id == 125) ++(data == Bytes{5, 1} ? trigger_count : heartbeat_count);
    if (frame.topic_id == 7) logged += std::string(data.begin() + 5, data.end()) + "\n";
    if (frame.topic_id == 10 && answers) say(10, Bytes(8, 1));
  }
  void say(uint16_t id, const Bytes& data) {
    Bytes out(data.size() + patrol::kFrameOverhead);
    patrol::encodeFrame(id, data.data(), data.size(), out.data(), out.size());
    to_sensor.insert(to_sensor.end(), out.begin(), out.end());
  }
  int triggers() const { return trigger_count; }
  int heartbeats() const { return heartbeat_count; }
};

patrol::SensorConfig config() {
  patrol::SensorConfig settings = {};
  settings.publisher = {125, "motion_trigger", "rosbot_patrol/EspTrigger", "95f4bf9b776b2424e3a9da1182e3a9d2", 512};
  settings.identity = {5, nullptr, false};
  settings.motion = {60000, 5, 50, 600000};
  settings.heartbeat = 500;
  settings.trigger_max_age = 60000;
  return settings;
}

struct World {
  explicit World(uint32_t raw = 0, bool cold = false) : sensor(config(), board, bridge) {
    board.raw = raw;
    board.cold = cold;
    sensor.begin();
  }
  void run(uint32_t milliseconds) {
    for (uint32_t i = 0; i < milliseconds; ++i) {
      ++board.raw;
      sensor.step();
    }
  }
  void motion() {
    board.move(true);
    run(100);
    board.move(false);
    run(100);
  }
  bool said(const char* text) const { return board.lines.find(text) != std::string::npos; }

  FakeBoard board;
  FakeBridge bridge;
  MotionSensor sensor;
};

}  // namespace

TEST(heartbeats_come_twice_a_second) {
  World world;
  world.run(10300);
  CHECK(world.bridge.heartbeats() >= 20 && world.bridge.heartbeats() <= 21);
  EQUAL(world.bridge.triggers(), 0);
  EQUAL(world.bridge.opened, 1);
}

TEST(motion_goes_out_within_milliseconds) {
  World world;
  world.run(1000);
  world.board.move(true);
  int after = 0;
  while (world.bridge.triggers() == 0 && after < 100) {
    world.run(1);
    ++after;
  }
  EQUAL(after, 5);
  world.run(20000);
  EQUAL(world.bridge.triggers(), 1);
  CHECK(!world.sensor.triggerUnconfirmed());
}

TEST(motion_without_a_link_is_told_after_the_reconnect) {
  World world;
  world.run(1000);
  world.bridge.refuses = world.bridge.closes = true;
  world.run(100);
  world.motion();
  world.motion();
  world.run(20000);
  CHECK(world.sensor.triggerPending());
  world.bridge.refuses = world.bridge.closes = false;
  world.run(13000);
  EQUAL(world.bridge.triggers(), 1);
  CHECK(world.bridge.logged.find("there was no link until now (2 in all)") != std::string::npos);
  CHECK(world.bridge.logged.find("is back after") != std::string::npos);

  world.bridge.refuses = world.bridge.closes = true;
  world.run(100);
  world.motion();
  world.run(20000);
  world.bridge.refuses = world.bridge.closes = false;
  world.run(13000);
  EQUAL(world.bridge.triggers(), 2);
  CHECK(world.bridge.logged.find("there was no link until now (1 in all)") != std::string::npos);
}

TEST(after_a_link_that_held_the_first_try_is_soon) {
  World world;
  world.bridge.refuses = true;
  world.run(60000);
  world.bridge.refuses = false;
  world.run(35000);
  world.bridge.closes = true;
  world.run(3);
  world.bridge.closes = false;
  const int opened = world.bridge.opened;
  world.run(380);
  EQUAL(world.bridge.opened, opened + 1);
}

TEST(motion_that_could_not_be_told_for_a_minute_is_dropped) {
  World world;
  world.run(1000);
  world.bridge.refuses = world.bridge.closes = true;
  world.motion();
  world.run(61000);
  CHECK(!world.sensor.triggerPending());
  CHECK(world.said("motion of 60 s ago could not be told and is dropped"));
  world.bridge.refuses = world.bridge.closes = false;
  world.run(20000);
  EQUAL(world.bridge.triggers(), 0);
  CHECK(world.bridge.heartbeats() > 0);
}

TEST(motion_hurries_the_next_try) {
  World world;
  world.bridge.refuses = true;
  world.run(30000);
  world.bridge.refuses = false;
  world.board.move(true);
  world.run(20);
  EQUAL(world.bridge.triggers(), 1);
}

TEST(the_next_heartbeat_comes_half_a_second_after_a_trigger) {
  World world;
  world.run(1400);
  world.board.move(true);
  world.run(10);
  EQUAL(world.bridge.triggers(), 1);
  const int before = world.bridge.heartbeats();
  world.run(490);
  EQUAL(world.bridge.heartbeats(), before);
  world.run(20);
  EQUAL(world.bridge.heartbeats(), before + 1);
}

TEST(a_trigger_that_vanished_with_the_link_is_sent_again) {
  World world;
  world.run(100000);
  world.bridge.hears = false;  // the cable is cut: sends succeed and go nowhere
  world.motion();
  CHECK(world.sensor.triggerUnconfirmed());
  world.run(4000);
  CHECK(world.said("no answer to a trigger for 4 s"));
  world.bridge.hears = true;
  world.run(1000);
  EQUAL(world.bridge.triggers(), 1);
  EQUAL(world.bridge.opened, 2);
  world.run(5000);
  CHECK(!world.sensor.triggerUnconfirmed());
}

TEST(a_confirmed_trigger_is_not_sent_again) {
  World world;
  world.run(1000);
  world.motion();
  world.bridge.closes = true;
  world.run(50);
  world.bridge.closes = false;
  world.run(5000);
  EQUAL(world.bridge.opened, 2);
  EQUAL(world.bridge.triggers(), 1);
}

TEST(a_bridge_that_is_silent_is_left_after_11_s) {
  World world;
  world.run(1000);
  world.bridge.answers = false;
  world.run(13000);
  CHECK(world.said("the bridge has not told the time for 11 s"));
  CHECK(world.bridge.opened >= 2);
}

TEST(a_bridge_that_takes_nothing_is_left_after_5_s) {
  World world;
  world.run(1000);
  world.bridge.takes = false;
  world.run(5600);
  CHECK(world.said("the bridge takes nothing any more"));
}

TEST(connecting_gives_up_after_5_s) {
  World world;
  world.bridge.reachable = false;
  world.run(5500);
  CHECK(world.said("no answer for 5 s"));
}

TEST(tries_become_rarer) {
  World world;
  world.bridge.refuses = true;
  world.run(60000);
  const int first = world.bridge.opened;
  CHECK(first >= 8 && first <= 20);
  world.run(600000);
  const int later = world.bridge.opened - first;
  CHECK(later >= 45 && later <= 160);
}

TEST(wifi_is_joined_again_and_the_link_follows) {
  World world;
  world.run(1000);
  world.board.up = false;
  world.run(10);
  CHECK(world.said("Wi-Fi is lost"));
  EQUAL(static_cast<int>(world.bridge.state), static_cast<int>(LinkState::kClosed));
  const int opened = world.bridge.opened;
  world.motion();
  world.run(40000);
  CHECK(world.board.joins >= 2 && world.board.joins <= 12);
  EQUAL(world.bridge.opened, opened);
  world.board.up = true;
  world.run(20);
  EQUAL(world.bridge.triggers(), 1);
}

TEST(while_it_warms_up_there_are_heartbeats_but_no_triggers) {
  World world(0, true);
  CHECK(world.said("warms up for 60 s"));
  world.run(20000);
  world.motion();
  world.run(39900);
  CHECK(world.bridge.heartbeats() > 100);
  EQUAL(world.bridge.triggers(), 0);
  CHECK(world.said("motion counts from now on"));
  CHECK(world.bridge.logged.find("is warm") != std::string::npos);
  world.motion();
  EQUAL(world.bridge.triggers(), 1);
}

TEST(all_goes_on_where_the_milliseconds_wrap) {
  for (const uint32_t before : {1U, 3U, 400U, 2000U, 12000U}) {
    World world(0xFFFFFFFFU - before);
    for (int i = 0; i < 30; ++i) {
      world.motion();
      world.run(800);
    }
    EQUAL(world.bridge.triggers(), 30);
    EQUAL(world.bridge.opened, 1);
    CHECK(world.bridge.heartbeats() >= 25);
  }
}

TEST(warm_up_and_age_hold_over_the_wrap) {
  World cold(0xFFFFFFFFU - 30000U, true);
  cold.run(59000);
  CHECK(cold.sensor.input().warming());
  cold.run(1001);
  CHECK(!cold.sensor.input().warming());

  World late(0xFFFFFFFFU - 30000U);
  late.bridge.refuses = true;
  late.run(20000);
  late.motion();
  late.run(59000);
  CHECK(late.sensor.triggerPending());
  late.run(1000);
  CHECK(!late.sensor.triggerPending());
}

TEST(a_flood_from_the_bridge_does_not_hold_the_loop) {
  World world;
  world.run(1000);
  for (int i = 0; i < 100000; ++i) world.bridge.to_sensor.push_back(static_cast<uint8_t>(i * 7));
  world.run(1);
  CHECK(world.bridge.to_sensor.size() > 90000);
  world.motion();
  EQUAL(world.bridge.triggers(), 1);
}

TEST(spikes_are_told_once_a_minute) {
  World world;
  world.run(1000);
  for (int i = 0; i < 100; ++i) {
    world.board.move(true);
    world.run(2);
    world.board.move(false);
    world.run(98);
  }
  EQUAL(world.bridge.triggers(), 0);
  size_t lines = 0;
  for (size_t at = 0; (at = world.board.lines.find("a spike", at)) != std::string::npos; ++at) ++lines;
  EQUAL(lines, 1U);
}

/** A bridge and a link with an event every few seconds, until `calm_from`. */
struct Trouble {
  explicit Trouble(uint32_t seed) : state(seed * 2654435761U) {}

  uint32_t random(uint32_t limit) {
    state = state * 1664525U + 1013904223U;
    return (state >> 8) % limit;
  }
  void step(World* world, uint32_t now, bool calm) {
    FakeBridge& bridge = world->bridge;
    if (now < change_at && !(calm && bad)) {
      if (bridge.state == LinkState::kClosed) bridge.closes = bridge.refuses;
      return;
    }
    change_at = now + 200 + random(8000);
    const bool was_cut = cut;
    cut = !calm && random(3) == 0;
    bridge.refuses = !calm && random(4) == 0;
    bridge.closes = was_cut || bridge.refuses;  // after a cut TCP does not resume as if nothing had happened
    bridge.hears = bridge.reachable = !cut;
    bridge.takes = calm || random(6) != 0;
    world->board.up = calm || random(8) != 0;
    bad = cut || bridge.refuses || !bridge.takes || !world->board.up;
    if (bad || bridge.closes) good_since = now;
  }

  uint32_t state;
  uint32_t change_at = 0;
  uint32_t good_since = 0;
  bool cut = false;
  bool bad = false;
};

TEST(whatever_happens_to_the_link_no_motion_is_lost) {
  int reconnects = 0;
  for (uint32_t seed = 1; seed <= 12; ++seed) {
    World world(0xFFFFFFFFU - 300000U);  // it wraps during the test
    world.board.seed = seed;
    Trouble trouble(seed);
    uint32_t move_at = 2000;
    uint32_t moved_at = 0;
    uint32_t motions = 0;
    bool waiting = false;  // for a motion to be reported
    for (uint32_t now = 0; now < 630000; ++now) {
      trouble.step(&world, now, now >= 600000);
      if (now == move_at && now < 600000) {
        world.board.move(true);
        waiting = true;
        moved_at = now;
        ++motions;
      }
      if (now == move_at + 100) {
        world.board.move(false);
        move_at += 25000 + trouble.random(25000);
      }
      const int before = world.bridge.triggers();
      world.run(1);
      if (world.bridge.triggers() > before) waiting = false;
      if (world.said("is dropped")) waiting = false;  // after a minute it can only log this
      world.board.lines.clear();
      if (waiting && now - trouble.good_since > 20000 && now - moved_at > 20000) {
        CHECK(!"a motion is told 20 s after the link is well");
        waiting = false;
      }
    }
    CHECK(motions >= 12);
    CHECK(!waiting && !world.sensor.triggerPending() && !world.sensor.triggerUnconfirmed());
    CHECK(world.bridge.triggers() >= static_cast<int>(motions) / 2);
    CHECK(world.bridge.triggers() <= static_cast<int>(motions) + world.bridge.opened);
    CHECK(world.bridge.heartbeats() > 200);
    reconnects += world.bridge.opened;
  }
  CHECK(reconnects > 300);
}
