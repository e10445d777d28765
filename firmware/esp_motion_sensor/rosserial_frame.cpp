#include "rosserial_frame.h"

#include <string.h>

namespace patrol {
namespace {

constexpr uint8_t kSync = 0xff;
constexpr uint8_t kProtocol = 0xfe;
constexpr size_t kLengthEnd = 5;  // sync bytes, length and its checksum

uint8_t sumOf(const uint8_t* data, size_t size) {
  unsigned sum = 0;
  for (size_t i = 0; i < size; ++i) sum += data[i];
  return static_cast<uint8_t>(sum);
}

/** Whether a frame may begin here; the second sync byte may still be missing. */
bool mayBegin(const uint8_t* data, size_t size) { return data[0] == kSync && (size < 2 || data[1] == kProtocol); }

uint8_t checksum(const uint8_t* data, size_t size) { return static_cast<uint8_t>(255 - sumOf(data, size)); }

}  // namespace

size_t encodeFrame(uint16_t topic_id, const uint8_t* data, size_t size, uint8_t* out, size_t room) {
  if (size > 0x7fff || room < size + kFrameOverhead) return 0;
  out[0] = kSync;
  out[1] = kProtocol;
  out[2] = static_cast<uint8_t>(size);
  out[3] = static_cast<uint8_t>(size >> 8);
  out[4] = checksum(out + 2, 2);
  out[5] = static_cast<uint8_t>(topic_id);
  out[6] = static_cast<uint8_t>(topic_id >> 8);
  if (size > 0) memcpy(out + 7, data, size);
  out[7 + size] = checksum(out + 5, size + 2);
  return size + kFrameOverhead;
}

size_t FrameParser::write(const uint8_t* data, size_t size) {
  drop(taken_);
  const size_t room = sizeof(buffer_) - size_;
  const size_t count = size < room ? size : room;
  if (count > 0) memcpy(buffer_ + size_, data, count);
  size_ += count;
  return count;
}

bool FrameParser::next(Frame* frame) {
  drop(taken_);
  for (;;) {
    size_t start = 0;
    while (start < size_ && !mayBegin(buffer_ + start, size_ - start)) ++start;
    skip(start);
    if (size_ < kLengthEnd) return false;
    const size_t length = static_cast<size_t>(buffer_[2] | buffer_[3] << 8);
    if (sumOf(buffer_ + 2, 3) != 255 || length > kMaxReceived) {
      skip(1);
      continue;
    }
    const size_t whole = length + kFrameOverhead;
    if (size_ < whole) return false;
    if (sumOf(buffer_ + kLengthEnd, length + 3) != 255) {
      skip(1);
      continue;
    }
    frame->topic_id = static_cast<uint16_t>(buffer_[5] | buffer_[6] << 8);
    frame->data = buffer_ + 7;
    frame->size = length;
    taken_ = whole;
    return true;
  }
}

void FrameParser::giveUp() {
  drop(taken_);
  if (size_ > 0) skip(1);
}

void FrameParser::drop(size_t count) {
  if (count == 0) return;
  size_ -= count;
  memmove(buffer_, buffer_ + count, size_);
  taken_ = 0;
}

void FrameParser::skip(size_t count) {
  garbage_ += static_cast<uint32_t>(count);
  drop(count);
}

}  // namespace patrol
