// Interfaces of the board: the only connection between the sensor's logic and the ESP32, or the tests.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "rosserial_client.h"

namespace patrol {

/** Clock, pins, log line, watchdog and Wi-Fi. No call blocks. */
class Board : public RandomSource {
 public:
  virtual uint32_t milliseconds() = 0;  // wraps
  virtual uint32_t random() = 0;
  virtual bool poweredOn() = 0;            // whether the board was powered on, not reset
  virtual bool motionLevel() = 0;          // the PIR's output
  virtual bool takeEdge(uint32_t* at) = 0; // whether the output rose since the last call, and when
  virtual void setLed(bool on) = 0;
  virtual void log(const char* line) = 0;
  virtual void feedWatchdog() = 0;

  virtual void joinNetwork() = 0;  // start to join Wi-Fi again
  virtual bool networkUp() = 0;    // whether the board has an address

 protected:
  ~Board() = default;
};

enum class LinkState : uint8_t { kClosed, kConnecting, kOpen };

/** One TCP connection to the bridge. No call blocks. (lwIP may have macros named open, send, poll and so on.) */
class Link {
 public:
  virtual void dial() = 0;
  virtual LinkState progress() = 0;                            // kClosed after a failure: see error()
  virtual int readSome(uint8_t* data, size_t room) = 0;        // bytes read, 0: nothing now, -1: the link is gone
  virtual int writeSome(const uint8_t* data, size_t size) = 0; // bytes taken, 0: no room now, -1: the link is gone
  virtual void hangUp() = 0;
  virtual const char* error() const = 0;

 protected:
  ~Link() = default;
};

}  // namespace patrol
