#include "motion_sensor.h"

#include <stdio.h>

namespace patrol {
namespace {

constexpr uint32_t kNetworkFirst = 12000;  // joining Wi-Fi takes some seconds; an earlier retry would restart it
constexpr uint32_t kNetworkLongest = 30000;
constexpr uint32_t kLinkFirst = 250;
constexpr uint32_t kLinkLongest = 8000;
constexpr uint64_t kConnectTimeout = 5000;
constexpr uint64_t kSendTimeout = 5000;     // if no byte is sent for this long, the link is dead
constexpr uint64_t kReceiptTimeout = 4000;  // for the answer to the time request behind a trigger
constexpr uint64_t kStable = 10000;         // a connection of this length resets the backoff
constexpr uint64_t kMotionShown = 1000;
constexpr uint64_t kSpikePeriod = 60000;
constexpr uint64_t kLate = 1000;            // a later trigger is explained in the log
constexpr int kReadsPerStep = 4;

unsigned long seconds(uint64_t milliseconds) { return static_cast<unsigned long>(milliseconds / 1000); }

}  // namespace

MotionSensor::MotionSensor(const SensorConfig& config, Board& board, Link& link)
    : config_(config),
      board_(board),
      link_(link),
      input_(config.motion),
      client_(config.publisher, config.identity, board),
      network_backoff_(kNetworkFirst, kNetworkLongest),
      link_backoff_(kLinkFirst, kLinkLongest) {}

void MotionSensor::begin() {
  clock_ = Clock(board_.milliseconds());
  const bool cold = board_.poweredOn();
  input_.begin(cold, clock_.now());
  say("sensor %u starts after %s", config_.identity.sensor_id, cold ? "power on" : "a reset");
  if (input_.warming()) {
    say("the motion sensor warms up for %lu s: heartbeats, but no triggers", seconds(input_.warmUpLeft(clock_.now())));
  }
  network_due_ = clock_.now();
}

void MotionSensor::step() {
  const uint64_t now = clock_.update(board_.milliseconds());
  board_.feedWatchdog();
  readMotion(now);
  keepNetwork(now);
  keepLink(now);
  dropOld(now);
  showState(now);
}

void MotionSensor::readMotion(uint64_t now) {
  uint32_t raw = 0;
  if (board_.takeEdge(&raw)) input_.edge(clock_.timeOf(raw));
  switch (input_.update(board_.motionLevel(), now)) {
    case Motion::kNothing:
      break;
    case Motion::kWarm:
      say("the motion sensor is warm, motion counts from now on");
      tellBridge(LogLevel::kInfo, "sensor %u is warm, motion counts from now on", config_.identity.sensor_id);
      break;
    case Motion::kBegan:
      say("motion");
      pending_.raised = true;
      pending_.at = input_.beganAt();
      ++late_motions_;
      motion_shown_until_ = now + kMotionShown;
      if (link_state_ == LinkState::kClosed && link_due_ > now) {  // motion does not wait for the next try
        link_due_ = now;
        link_backoff_.reset();
      }
      break;
    case Motion::kEnded:  // helps to set the module's hold time
      say("no motion any more, the output was high for %lu ms",
          static_cast<unsigned long>(now - input_.beganAt() - config_.motion.release));
      break;
    case Motion::kSpike:
      ++spikes_;
      if (spikes_ == 1 || now - spikes_told_at_ >= kSpikePeriod) {
        spikes_told_at_ = now;
        say("a spike on the motion sensor's output, shorter than %lu ms: ignored (%lu so far)",
            static_cast<unsigned long>(config_.motion.confirm), static_cast<unsigned long>(spikes_));
      }
      break;
    case Motion::kStuck:
      say("the motion sensor's output has been high for %lu s", seconds(config_.motion.stuck));
      tellBridge(LogLevel::kWarn, "sensor %u: its output has been high for %lu s", config_.identity.sensor_id,
                 seconds(config_.motion.stuck));
      break;
  }
}

void MotionSensor::keepNetwork(uint64_t now) {
  const bool up = board_.networkUp();
  if (up != network_up_) {
    network_up_ = up;
    if (up) {
      say("Wi-Fi is there");
      network_backoff_.reset();
      link_backoff_.reset();
      // After a power cut all sensors start at once: spread their first connections.
      link_due_ = pending_.raised ? now : now + board_.random() % (kLinkFirst + 1);
    } else {
      say("Wi-Fi is lost");
      if (link_state_ != LinkState::kClosed) loseLink("Wi-Fi is lost", now);
      network_due_ = now + network_backoff_.next(board_.random());  // first the Wi-Fi driver itself retries
    }
  }
  if (!up && now >= network_due_) {
    board_.joinNetwork();
    network_due_ = now + network_backoff_.next(board_.random());
  }
}

void MotionSensor::keepLink(uint64_t now) {
  switch (link_state_) {
    case LinkState::kClosed:
      if (!network_up_ || now < link_due_) return;
      link_.dial();
      link_state_ = LinkState::kConnecting;
      link_since_ = now;
      break;
    case LinkState::kConnecting:
      connecting(now);
      break;
    case LinkState::kOpen:
      talk(now);
      break;
  }
}

void MotionSensor::connecting(uint64_t now) {
  switch (link_.progress()) {
    case LinkState::kOpen:
      link_state_ = LinkState::kOpen;
      link_since_ = send_moved_at_ = now;
      was_configured_ = false;
      client_.begin(now);
      talk(now);
      break;
    case LinkState::kClosed:
      loseLink(link_.error(), now);
      break;
    case LinkState::kConnecting:
      if (now - link_since_ > kConnectTimeout) loseLink("no answer for 5 s", now);
      break;
  }
}

void MotionSensor::talk(uint64_t now) {
  uint8_t data[256];
  for (int i = 0; i < kReadsPerStep; ++i) {  // bounded, so that a flood does not block the loop
    const int count = link_.readSome(data, sizeof(data));
    if (count < 0) {
      loseLink(link_.error(), now);
      return;
    }
    if (count == 0) break;
    client_.receive(data, static_cast<size_t>(count), now);
    if (client_.fault() != nullptr) break;
  }
  client_.tick(now);
  if (client_.fault() == nullptr) {
    configuredNow(now);
    report(now);
  }
  flush(now);
  if (link_state_ == LinkState::kOpen && client_.fault() != nullptr) loseLink(client_.fault(), now);
}

void MotionSensor::configuredNow(uint64_t now) {
  const bool configured = client_.configured();
  if (configured == was_configured_) return;
  was_configured_ = configured;
  if (!configured) {
    say("the bridge stopped the traffic");
    return;
  }
  ++connections_;
  heartbeat_due_ = now;
  say("the bridge listens%s", client_.bridgeProven() ? ", and has proved that it is ours" : "");
  if (config_.identity.key != nullptr && !client_.bridgeProven() && !plain_told_) {
    plain_told_ = true;
    say("this sensor has a key, but the bridge did not ask for it");
  }
  if (connections_ == 1) {
    tellBridge(LogLevel::kInfo, "sensor %u started %lu s ago after %s%s", config_.identity.sensor_id, seconds(now),
               board_.poweredOn() ? "power on" : "a reset", input_.warming() ? " and warms up" : "");
  } else {
    tellBridge(LogLevel::kInfo, "sensor %u is back after %lu s, connection %lu", config_.identity.sensor_id,
               seconds(now - link_lost_at_), static_cast<unsigned long>(connections_));
  }
}

void MotionSensor::report(uint64_t now) {
  if (in_flight_.raised && client_.answered(in_flight_.receipt)) in_flight_.raised = false;
  if (in_flight_.raised && now - in_flight_.sent_at > kReceiptTimeout) {
    loseLink("no answer to a trigger for 4 s", now);
    return;
  }
  if (!client_.configured()) return;
  const uint8_t id = config_.identity.sensor_id;
  if (pending_.raised) {
    const uint8_t message[2] = {id, 1};
    if (!client_.publish(message, sizeof(message))) return;  // the output is full: retry in the next step
    if (now - pending_.at > kLate) {
      say("motion of %lu s ago is told now, %lu in all", seconds(now - pending_.at),
          static_cast<unsigned long>(late_motions_));
      tellBridge(LogLevel::kWarn, "sensor %u: motion began %lu s ago, there was no link until now (%lu in all)", id,
                 seconds(now - pending_.at), static_cast<unsigned long>(late_motions_));
    }
    in_flight_ = pending_;
    in_flight_.receipt = client_.requestTime(now);
    in_flight_.sent_at = now;
    pending_.raised = false;
    late_motions_ = 0;
    heartbeat_due_ = now + config_.heartbeat;
  } else if (now >= heartbeat_due_) {
    const uint8_t message[2] = {id, 0};
    if (client_.publish(message, sizeof(message))) heartbeat_due_ = now + config_.heartbeat;
  }
}

void MotionSensor::flush(uint64_t now) {
  if (link_state_ != LinkState::kOpen) return;
  while (client_.outputSize() > 0) {
    const int count = link_.writeSome(client_.output(), client_.outputSize());
    if (count < 0) {
      loseLink(link_.error(), now);
      return;
    }
    if (count == 0) break;
    client_.sent(static_cast<size_t>(count));
    send_moved_at_ = now;
  }
  if (client_.outputSize() == 0) {
    send_moved_at_ = now;
  } else if (now - send_moved_at_ > kSendTimeout) {
    loseLink("the bridge takes nothing any more", now);
  }
}

void MotionSensor::dropOld(uint64_t now) {
  if (!pending_.raised || now - pending_.at <= config_.trigger_max_age) return;
  say("motion of %lu s ago could not be told and is dropped", seconds(now - pending_.at));
  pending_.raised = false;
  late_motions_ = 0;
}

void MotionSensor::loseLink(const char* why, uint64_t now) {
  link_.hangUp();
  const bool held = link_state_ == LinkState::kOpen && was_configured_;
  if (held) link_lost_at_ = now;
  if (held && now - link_since_ > kStable) link_backoff_.reset();
  link_state_ = LinkState::kClosed;
  was_configured_ = false;
  if (in_flight_.raised) {  // its arrival is unknown: better twice than never (pending_.at is still its time)
    pending_.raised = true;
    ++late_motions_;
    in_flight_.raised = false;
  }
  const uint32_t wait = link_backoff_.next(board_.random());
  link_due_ = now + wait;
  say("no link to the bridge: %s; next try in %lu ms", why, static_cast<unsigned long>(wait));
}

void MotionSensor::showState(uint64_t now) {
  board_.setLed(ledOn(now < motion_shown_until_ ? SensorState::kMotion : state(), now));
}

SensorState MotionSensor::state() const {
  if (!network_up_) return SensorState::kNoNetwork;
  if (!client_.configured() || link_state_ != LinkState::kOpen) return SensorState::kNoBridge;
  return input_.warming() ? SensorState::kWarming : SensorState::kGuarding;
}

void MotionSensor::say(const char* format, ...) {
  char line[160];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(line, sizeof(line), format, arguments);
  va_end(arguments);
  board_.log(line);
}

void MotionSensor::tellBridge(LogLevel level, const char* format, ...) {
  char line[144];
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(line, sizeof(line), format, arguments);
  va_end(arguments);
  client_.log(level, line);  // best effort: the messages contain everything that the bridge must know
}

}  // namespace patrol
