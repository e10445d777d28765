// The host's side of the fakes: inputs that a test gives the board, and outputs of the board.
#pragma once

#include <stdint.h>

namespace host {

/** Settings of the sensor, from the program's arguments; times in milliseconds. */
struct Options {
  const char* bridge = "localhost";
  uint16_t port = 11411;
  uint8_t id = 1;
  const char* key = "";
  bool insist = false;
  uint32_t warm_up = 0;
  uint32_t max_age = 60000;
  uint32_t clock_offset = 0;  // start value of millis(), to test its wrap-around
  bool after_reset = false;   // not powered on just now: no warm-up
};

/** The options; the sketch's global objects read them, so they are set before those are constructed. */
Options& options();

/** Milliseconds since the program started, plus the offset. */
uint32_t boardMilliseconds();

void setPin(bool high);  // calls the interrupt handler on a rising edge, on the caller's thread
void setWifi(bool up);
void cutCable(bool cut);     // packets vanish: sends are lost, nothing is received, connects do not end
void stopInMidFrame();       // the next send takes only half of its bytes; waits for it
bool watchdogStarved();      // whether the loop has not fed the watchdog within its timeout

}  // namespace host
