// Motion from the edges of the HC-SR501's output.
#pragma once

#include <stdint.h>

namespace patrol {

/** Timing of the output [ms]. */
struct MotionTiming {
  uint32_t warm_up;  // after power on the module triggers at random
  uint32_t confirm;  // high for this long is motion, shorter is a spike (the module holds its output for seconds)
  uint32_t release;  // low for this long ends a motion
  uint32_t stuck;    // high for longer is reported as stuck
};

/** Result of one `update`. */
enum class Motion : uint8_t { kNothing, kWarm, kBegan, kEnded, kSpike, kStuck };

/** Follow the output by its interrupt and its level; one `kBegan` per time it goes high. */
class MotionInput {
 public:
  explicit MotionInput(const MotionTiming& timing) : timing_(timing) {}

  /**
   * Start; `cold` where the module was switched on just now and has to warm up. Otherwise an output that is high
   * already is motion: nobody knows whether it was told before the reset.
   */
  void begin(bool cold, uint64_t now);

  /** Record a rising edge seen by the interrupt. */
  void edge(uint64_t when);

  /** Check the level; call it often, because it confirms motions. */
  Motion update(bool level, uint64_t now);

  /** Start time of the last reported motion [ms]. */
  uint64_t beganAt() const { return began_at_; }

  bool warming() const { return state_ == State::kWarming; }
  bool active() const { return state_ == State::kActive || state_ == State::kEnding; }

  /** Time until the module is warm [ms]. */
  uint64_t warmUpLeft(uint64_t now) const { return warming() && now < warm_at_ ? warm_at_ - now : 0; }

  /** Whether `update` should be called again within milliseconds. */
  bool deciding() const { return state_ == State::kRising; }

 private:
  enum class State : uint8_t { kWarming, kIdle, kRising, kActive, kEnding };

  const MotionTiming timing_;
  State state_ = State::kWarming;
  bool edge_seen_ = false;
  bool stuck_told_ = false;
  uint64_t edge_at_ = 0;
  uint64_t warm_at_ = 0;
  uint64_t since_ = 0;
  uint64_t began_at_ = 0;
};

}  // namespace patrol
