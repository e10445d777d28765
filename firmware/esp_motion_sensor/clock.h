// Time that does not wrap: the board's 32-bit milliseconds start again at 0 after 49.7 days, these do not.
#pragma once

#include <stdint.h>

namespace patrol {

/** Counts on from the board's milliseconds; `update` has to be called more often than every 49 days. */
class Clock {
 public:
  explicit Clock(uint32_t raw = 0) : last_(raw) {}

  /** Take the board's reading; returns the time since construction [ms]. */
  uint64_t update(uint32_t raw) {
    now_ += static_cast<uint32_t>(raw - last_);
    last_ = raw;
    return now_;
  }

  /** The time of the last `update` [ms]. */
  uint64_t now() const { return now_; }

  /** When a reading of the last 24 days was taken [ms]; one newer than the last `update` counts as now. */
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
