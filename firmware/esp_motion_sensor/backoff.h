// Waits between tries: longer each time, and never the same for two sensors.
#pragma once

#include <stdint.h>

namespace patrol {

/** Doubling waits with jitter, so that sensors that lost the same bridge do not reconnect in step. */
class Backoff {
 public:
  /** The first wait and the longest one [ms], before jitter. */
  Backoff(uint32_t first, uint32_t longest) : first_(first), longest_(longest), base_(first) {}

  /** The next wait [ms]: the base, reduced or increased by up to a half; `random` is any number. */
  uint32_t next(uint32_t random) {
    const uint32_t wait = base_ - base_ / 2 + random % (base_ + 1);
    base_ = base_ > longest_ / 2 ? longest_ : base_ * 2;
    return wait;
  }

  /** Start with the first wait again. */
  void reset() { base_ = first_; }

 private:
  uint32_t first_;
  uint32_t longest_;
  uint32_t base_;
};

}  // namespace patrol
