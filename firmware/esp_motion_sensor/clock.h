// Time without wrap-around: the board's 32-bit milliseconds restart at 0 after 49.7 days.
#pragma once

#include <stdint.h>

namespace patrol {

/** Continuous time from the board's milliseconds; call `update` at least once in 49 days. */
class Clock {
 public:
  explicit Clock(uint32_t raw = 0) : last_(raw) {}

  /** Process the board's reading; returns the time since construction [ms]. */
  uint64_t update(uint32_t raw) {
    now_ += static_cast<uint32_t>(raw - last_);
    last_ = raw;
    return now_;
  }

  /** The time of the last `update` [ms]. */
  uint64_t now() const { return now_; }

  /** Time of a reading of the last 24 days [ms]; a reading newer than the last `update` counts as now. */
  uint64_t timeOf(uint32_t raw) const {
    const uint32_t age = last_ - raw;
    if (age > 0x7FFFFFFFU || age > now_) return now_;
    return now_ - age;
  }

 private:
  uint32_t last_;
  uint64_t now_ = 0;
};

}  // namespace patrol
