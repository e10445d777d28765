// The HC-SR501's output: which of its edges are motion.
#pragma once

#include <stdint.h>

namespace patrol {

/** How the output is read [ms]. */
struct MotionTiming {
  uint32_t warm_up;  // after power on the module fires at random
  uint32_t confirm;  // high for that long is motion, for less a spike (the module holds its output for seconds)
  uint32_t release;  // low for that long ends a motion
  uint32_t stuck;    // high for longer than that is told
};

/** What one `update` found. */
enum class Motion : uint8_t { kNothing, kWarm, kBegan, kEnded, kSpike, kStuck };

/** Follows the output by its interrupt and its level; one `kBegan` for each time it goes high. */
class MotionInput {
 public:
  explicit MotionInput(const MotionTiming& timing) : timing_(timing) {}

  /**
   * Start; `cold` where the module was switched on just now and has to warm up. Otherwise an output that is high
   * already is motion: nobody knows whether it was told before the reset.
   */
  void begin(bool cold, uint64_t now);

  /** The interrupt saw a rising edge. */
  void edge(uint64_t when);

  /** Look at the level; call it often, as a motion is confirmed here. */
  Motion update(bool level, uint64_t now);

  /** When the motion told last began [ms]. */
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
