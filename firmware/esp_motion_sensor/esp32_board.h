// The ESP32 as a `Board`: the only file, with its .cpp, that calls Arduino's functions for pins, Wi-Fi and watchdog.
#pragma once

#include "hardware.h"

namespace patrol {

/** The board; the interrupt handler supports only one instance. */
class Esp32Board final : public Board {
 public:
  Esp32Board(int pir_pin, int led_pin) : pir_pin_(pir_pin), led_pin_(led_pin) {}

  /** Set up pins, interrupt, watchdog and log; once, from setup(). */
  void begin(uint32_t watchdog_s);

  /** Rest for a moment; the motion interrupt ends it at once. */
  void rest(uint32_t milliseconds);

  uint32_t milliseconds() override;
  uint32_t random() override;
  void fill(uint8_t* data, size_t size) override;
  bool poweredOn() override;
  bool motionLevel() override;
  bool takeEdge(uint32_t* at) override;
  void setLed(bool on) override;
  void log(const char* line) override;
  void feedWatchdog() override;
  void joinNetwork() override;
  bool networkUp() override;

 private:
  const int pir_pin_;
  const int led_pin_;
  bool led_on_ = false;
  bool wifi_begun_ = false;
  bool wifi_was_up_ = false;
};

}  // namespace patrol
