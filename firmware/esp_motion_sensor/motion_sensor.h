// The sensor: motion in, EspTrigger out, over a link that may break at any time.
#pragma once

#include <stdarg.h>
#include <stdint.h>

#include "backoff.h"
#include "clock.h"
#include "hardware.h"
#include "motion_input.h"
#include "rosserial_client.h"
#include "status_led.h"

namespace patrol {

/** All times in milliseconds. */
struct SensorConfig {
  Publisher publisher;
  Identity identity;
  MotionTiming motion;
  uint32_t heartbeat;        // time between two messages
  uint32_t trigger_max_age;  // a motion that could not be sent for longer is dropped
};

/** Call `begin` once and `step` forever; neither blocks. */
class MotionSensor {
 public:
  MotionSensor(const SensorConfig& config, Board& board, Link& link);

  void begin();
  void step();

  /** Longest rest of the loop before the next `step` [ms]; an interrupt should end the rest. */
  uint32_t restFor() const { return input_.deciding() ? 1 : 2; }

  const MotionInput& input() const { return input_; }
  bool triggerPending() const { return pending_.raised; }
  bool triggerUnconfirmed() const { return in_flight_.raised; }

 private:
  /** A motion on its way to the bridge. */
  struct Trigger {
    bool raised = false;
    uint64_t at = 0;       // start of the motion
    uint32_t receipt = 0;  // number of the time request behind it
    uint64_t sent_at = 0;
  };

  void readMotion(uint64_t now);
  void keepNetwork(uint64_t now);
  void keepLink(uint64_t now);
  void connecting(uint64_t now);
  void talk(uint64_t now);
  void configuredNow(uint64_t now);
  void report(uint64_t now);
  void flush(uint64_t now);
  void dropOld(uint64_t now);
  void loseLink(const char* why, uint64_t now);
  void showState(uint64_t now);
  SensorState state() const;
  void say(const char* format, ...) __attribute__((format(printf, 2, 3)));
  void tellBridge(LogLevel level, const char* format, ...) __attribute__((format(printf, 3, 4)));

  const SensorConfig config_;
  Board& board_;
  Link& link_;
  Clock clock_;
  MotionInput input_;
  RosserialClient client_;
  Backoff network_backoff_;
  Backoff link_backoff_;
  LinkState link_state_ = LinkState::kClosed;
  bool network_up_ = false;
  bool was_configured_ = false;  // on this connection
  bool plain_told_ = false;
  Trigger pending_;
  Trigger in_flight_;
  uint32_t late_motions_ = 0;  // motions that the pending trigger represents
  uint32_t connections_ = 0;
  uint32_t spikes_ = 0;
  uint64_t network_due_ = 0;
  uint64_t link_due_ = 0;
  uint64_t link_since_ = 0;
  uint64_t link_lost_at_ = 0;
  uint64_t heartbeat_due_ = 0;
  uint64_t send_moved_at_ = 0;
  uint64_t spikes_told_at_ = 0;
  uint64_t motion_shown_until_ = 0;
};

}  // namespace patrol
