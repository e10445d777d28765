// Patterns of the status LED.
#pragma once

#include <stdint.h>

namespace patrol {

/** In order of priority. */
enum class SensorState : uint8_t { kMotion, kNoNetwork, kNoBridge, kWarming, kGuarding };

/** Whether the LED is on at a time [ms]. */
inline bool ledOn(SensorState state, uint64_t now) {
  switch (state) {
    case SensorState::kMotion:
      return true;
    case SensorState::kNoNetwork:
      return now % 200 < 100;  // fast: no Wi-Fi
    case SensorState::kNoBridge:
      return now % 1000 < 500;  // slow: no bridge
    case SensorState::kWarming:
      return now % 2000 < 100 || (now % 2000 >= 300 && now % 2000 < 400);  // two flashes: warming up
    case SensorState::kGuarding:
      return now % 5000 < 30;  // a blink every 5 s: all is well
  }
  return false;
}

}  // namespace patrol
