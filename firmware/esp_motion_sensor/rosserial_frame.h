// Framing of rosserial (protocol byte 0xfe):
//   ff fe | length, 16 bit LE | 255 - sum(length bytes) % 256 | topic id, 16 bit LE | data | 255 - sum(id, data) % 256
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace patrol {

constexpr size_t kFrameOverhead = 8;
constexpr size_t kMaxReceived = 128;  // longest accepted payload from a bridge; the longest needed has 33

/** Write one frame to `out`; returns its size, 0 if it does not fit into `room`. */
size_t encodeFrame(uint16_t topic_id, const uint8_t* data, size_t size, uint8_t* out, size_t room);

/** One frame; `data` points into the parser and is valid until its next call. */
struct Frame {
  uint16_t topic_id;
  const uint8_t* data;
  size_t size;
};

/**
 * Parser of a byte stream into frames. Other bytes are skipped: the search continues directly behind the failed sync
 * bytes, so a truncated frame costs only itself. A frame longer than `kMaxReceived` counts as none.
 */
class FrameParser {
 public:
  /** Forget an incomplete frame, for a new connection. */
  void clear() { size_ = taken_ = 0; }

  /** Add bytes; returns how many were accepted, at least one after `next` has returned false. */
  size_t write(const uint8_t* data, size_t size);

  /** The next complete frame, false if there is none yet. */
  bool next(Frame* frame);

  /** Give up waiting for the rest of an incomplete frame: continue behind its first byte. */
  void giveUp();

  /** Whether a frame has begun and not ended. */
  bool pending() const { return size_ > taken_; }

  /** Number of skipped bytes that were not part of a frame. */
  uint32_t garbage() const { return garbage_; }

 private:
  void drop(size_t count);
  void skip(size_t count);

  uint8_t buffer_[kMaxReceived + kFrameOverhead] = {0};
  size_t size_ = 0;
  size_t taken_ = 0;  // bytes of the last returned frame, removed at the next call
  uint32_t garbage_ = 0;
};

}  // namespace patrol
