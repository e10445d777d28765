#include "rosserial_client.h"

#include <string.h>

namespace patrol {
namespace {

constexpr uint64_t kSyncPeriod = 2500;
constexpr uint64_t kSyncTimeout = 11000;
constexpr uint64_t kNegotiationTimeout = 15000;  // upstream's server asks after 2.1 s, and again every 15 s
constexpr uint64_t kFrameTimeout = 1000;         // a frame that stalls for longer is given up
constexpr size_t kMaxLog = 160;
constexpr size_t kMaxPayload = 256;  // longest data of a frame that is sent

/** Serialise a message as ROS 1 does; remember whether it fitted. */
class Writer {
 public:
  Writer(uint8_t* out, size_t room) : out_(out), room_(room) {}

  void u8(uint8_t value) { bytes(&value, 1); }
  void u16(uint16_t value) {
    u8(static_cast<uint8_t>(value));
    u8(static_cast<uint8_t>(value >> 8));
  }
  void u32(uint32_t value) {
    u16(static_cast<uint16_t>(value));
    u16(static_cast<uint16_t>(value >> 16));
  }
  void text(const char* value) {
    const size_t length = strlen(value);
    u32(static_cast<uint32_t>(length));
    bytes(reinterpret_cast<const uint8_t*>(value), length);
  }
  bool fits() const { return fits_; }
  size_t size() const { return size_; }

 private:
  void bytes(const uint8_t* data, size_t count) {
    fits_ = fits_ && count <= room_ - size_;
    if (!fits_) return;
    memcpy(out_ + size_, data, count);
    size_ += count;
  }

  uint8_t* out_;
  size_t room_;
  size_t size_ = 0;
  bool fits_ = true;
};

uint32_t readU32(const uint8_t* data) {
  return static_cast<uint32_t>(data[0]) | static_cast<uint32_t>(data[1]) << 8 | static_cast<uint32_t>(data[2]) << 16 |
         static_cast<uint32_t>(data[3]) << 24;
}

}  // namespace

RosserialClient::RosserialClient(const Publisher& publisher, const Identity& identity, RandomSource& random)
    : publisher_(publisher), identity_(identity), random_(random) {}

void RosserialClient::begin(uint64_t now) {
  parser_.clear();
  proof_.clear();
  configured_ = challenged_ = proven_ = false;
  fault_ = nullptr;
  requests_ = answers_ = 0;
  output_size_ = 0;
  last_bytes_ = waiting_since_ = now;
}

void RosserialClient::receive(const uint8_t* data, size_t size, uint64_t now) {
  last_bytes_ = now;
  Frame each;
  while (size > 0 && fault_ == nullptr) {
    const size_t taken = parser_.write(data, size);
    data += taken;
    size -= taken;
    while (fault_ == nullptr && parser_.next(&each)) frame(each, now);
  }
}

void RosserialClient::tick(uint64_t now) {
  Frame each;
  while (fault_ == nullptr && parser_.pending() && now - last_bytes_ > kFrameTimeout) {
    parser_.giveUp();
    while (fault_ == nullptr && parser_.next(&each)) frame(each, now);
  }
  if (!configured_) {
    if (now - waiting_since_ > kNegotiationTimeout) fail("the bridge asked for no topics for 15 s");
    return;
  }
  if (now - last_answer_ > kSyncTimeout) fail("the bridge has not told the time for 11 s");
  if (now - last_request_ > kSyncPeriod) requestTime(now);
}

bool RosserialClient::publish(const uint8_t* data, size_t size) {
  return configured_ && put(publisher_.id, data, size);
}

bool RosserialClient::log(LogLevel level, const char* text) {
  uint8_t data[kMaxLog];
  Writer writer(data, sizeof(data));
  writer.u8(static_cast<uint8_t>(level));
  writer.text(text);
  return configured_ && writer.fits() && put(kTopicLog, data, writer.size());
}

uint32_t RosserialClient::requestTime(uint64_t now) {
  const uint8_t zero[8] = {0};
  last_request_ = now;
  if (!put(kTopicTime, zero, sizeof(zero))) return requests_ + 1;  // no room: the next request will succeed
  return ++requests_;
}

void RosserialClient::sent(size_t count) {
  output_size_ -= count;
  memmove(output_, output_ + count, output_size_);
}

void RosserialClient::frame(const Frame& received, uint64_t now) {
  Frame frame = received;
  if (proven_ && frame.topic_id != kTopicChallenge && frame.topic_id != kTopicProof) {
    if (!from_bridge_.isNext(frame.topic_id, frame.data, frame.size)) {
      fail("somebody in between has changed what the bridge says");
      return;
    }
    from_bridge_.advance();
    frame.size -= kSignatureSize;
  }
  switch (frame.topic_id) {
    case kTopicPublisher:
      topicsAsked(now);
      break;
    case kTopicTime:
      timeTold(frame, now);
      break;
    case kTopicTxStop:
      configured_ = false;
      waiting_since_ = now;
      break;
    case kTopicChallenge:
      challenged(frame);
      break;
    case kTopicProof:
      bridgeProof(frame);
      break;
    default:  // nothing is subscribed, so other messages are not for a sensor
      break;
  }
}

void RosserialClient::topicsAsked(uint64_t now) {
  if (identity_.insist && !proven_) {
    fail("the bridge has not proved that it knows the key, and this sensor insists on it");
    return;
  }
  uint8_t data[256];
  Writer info(data, sizeof(data));
  info.u16(publisher_.id);
  info.text(publisher_.name);
  info.text(publisher_.type);
  info.text(publisher_.md5);
  info.u32(static_cast<uint32_t>(publisher_.buffer_size));
  requestTime(now);
  if (!info.fits() || !put(kTopicPublisher, data, info.size())) return;  // output full: it will ask again
  if (!configured_) last_answer_ = now;
  configured_ = true;
}

void RosserialClient::timeTold(const Frame& frame, uint64_t now) {
  if (frame.size != 8 || answers_ >= requests_) return;
  ++answers_;
  last_answer_ = now;
  bridge_time_ = static_cast<uint64_t>(readU32(frame.data)) * 1000 + readU32(frame.data + 4) / 1000000;
  bridge_time_at_ = now;
  knows_time_ = true;
}

void RosserialClient::challenged(const Frame& frame) {
  if (identity_.key == nullptr) {
    fail("the bridge wants a key, and this sensor has none (SENSOR_KEY in secrets.h)");
    return;
  }
  if (proven_) {
    fail("the bridge asks for the key a second time");
    return;
  }
  uint8_t nonce[kDeviceNonceSize];
  uint8_t proof[kProofSize];
  random_.fill(nonce, sizeof(nonce));
  configured_ = false;
  if (!proof_.answer(identity_.key, identity_.sensor_id, frame.data, frame.size, nonce, proof)) {
    fail("the bridge's challenge is of an unknown version");
    return;
  }
  challenged_ = true;
  put(kTopicProof, proof, sizeof(proof));
}

void RosserialClient::bridgeProof(const Frame& frame) {
  if (!challenged_ || proven_) return;
  proven_ = proof_.bridgeProves(frame.data, frame.size);
  if (!proven_) {
    fail("the bridge's proof is wrong: not our bridge, or another key");
    return;
  }
  from_sensor_.begin(proof_.session(), "from the sensor");
  from_bridge_.begin(proof_.session(), "from the bridge");
}

bool RosserialClient::put(uint16_t topic_id, const uint8_t* data, size_t size) {
  uint8_t payload[kMaxPayload + kSignatureSize];
  if (proven_) {
    if (size > kMaxPayload) return false;
    memcpy(payload, data, size);
    from_sensor_.sign(topic_id, data, size, payload + size);
    data = payload;
    size += kSignatureSize;
  }
  const size_t written = encodeFrame(topic_id, data, size, output_ + output_size_, sizeof(output_) - output_size_);
  output_size_ += written;
  if (proven_ && written > 0) from_sensor_.advance();
  return written > 0;
}

void RosserialClient::fail(const char* why) {
  fault_ = why;
  configured_ = false;
}

}  // namespace patrol
