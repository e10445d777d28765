// Framing of rosserial (protocol byte 0xfe):
//   ff fe | length, 16 bit LE | 255 - sum(length bytes) % 256 | topic id, 16 bit LE | data | 255 - sum(id, data) % 256
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace patrol {

constexpr size_t kFrameOverhead = 8;
constexpr size_t kMaxReceived = 128;  // longest payload taken from a bridge; the longest that a sensor needs has 33

/** Write one frame to `out`; returns its size, 0 where it does not fit into `room`. */
size_t encodeFrame(uint16_t topic_id, const uint8_t* data, size_t size, uint8_t* out, size_t room);

/** One frame; `data` points into the parser and holds until its next call. */
struct Frame {
  uint16_t topic_id;
  const uint8_t* data;
  size_t size;
};

/**
 * Turns a stream of bytes into frames. What is no frame is skipped: the search goes on right behind the sync bytes that
 * failed, so a frame that was cut off costs itself only. A frame longer than `kMaxReceived` counts as none.
 */
class FrameParser {
 public:
  /** Forget what has begun, as on a new connection. */
  void clear() { size_ = taken_ = 0; }

  /** Take bytes; returns how many were taken, at least one of them once `next` has returned false. */
  size_t write(const uint8_t* data, size_t size);

  /** The next whole frame, false where there is none yet. */
  bool next(Frame* frame);

  /** Stop waiting for the rest of the frame that has begun: go on behind its first byte. */
  void giveUp();

  /** Whether a frame has begun and not ended. */
  bool pending() const { return size_ > taken_; }

  /** Bytes skipped so far because they belonged to no frame. */
  uint32_t garbage() const { return garbage_; }

 private:
  void drop(size_t count);
  void skip(size_t count);

  uint8_t buffer_[kMaxReceived + kFrameOverhead] = {0};
  size_t size_ = 0;
  size_t taken_ = 0;  // bytes of the frame given last, dropped at the next call
  uint32_t garbage_ = 0;
};

}  // namespace patrol
