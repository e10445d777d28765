// A rosserial device without sockets: bytes in, bytes out. One publisher, time, log and the key.
//
// It behaves towards the bridge like rosserial's NodeHandle: it answers a topic request with a time request and its
// topic, asks for the time every 2.5 s, and gives up a connection after 11 s without an answer.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "key_proof.h"
#include "rosserial_frame.h"
#include "signed_frames.h"

namespace patrol {

/** Topic ids with a fixed meaning (rosserial_msgs/TopicInfo), and the two of the key. */
enum TopicId : uint16_t {
  kTopicPublisher = 0,
  kTopicLog = 7,
  kTopicChallenge = 8,
  kTopicProof = 9,
  kTopicTime = 10,
  kTopicTxStop = 11,
};

/** Levels of rosserial_msgs/Log. */
enum class LogLevel : uint8_t { kDebug = 0, kInfo = 1, kWarn = 2, kError = 3, kFatal = 4 };

/** The only published topic. */
struct Publisher {
  uint16_t id;
  const char* name;
  const char* type;
  const char* md5;
  int32_t buffer_size;
};

/** The sensor's side of the key. */
struct Identity {
  uint8_t sensor_id;
  const uint8_t* key;  // kKeySize bytes, or null
  bool insist;         // refuse a bridge that has not proved that it knows the key
};

/** Source of random bytes. */
class RandomSource {
 public:
  virtual void fill(uint8_t* data, size_t size) = 0;

 protected:
  ~RandomSource() = default;
};

/** One device; call `begin` for each new connection. All times are milliseconds of one clock without wrap-around. */
class RosserialClient {
 public:
  RosserialClient(const Publisher& publisher, const Identity& identity, RandomSource& random);

  /** Start a new connection. */
  void begin(uint64_t now);

  /** Process bytes from the bridge. */
  void receive(const uint8_t* data, size_t size, uint64_t now);

  /** Send due time requests; detect missing answers. */
  void tick(uint64_t now);

  /** Whether the bridge knows the topic, so that it accepts messages. */
  bool configured() const { return configured_; }

  /** Reason to give up the connection, null if there is none. */
  const char* fault() const { return fault_; }

  /** Whether the bridge has proved that it knows the key. */
  bool bridgeProven() const { return proven_; }

  /** Queue a message; false if the topic is not negotiated or the output is full. */
  bool publish(const uint8_t* data, size_t size);

  /** Queue a line for the bridge's log; false as in `publish`, and if it does not fit. */
  bool log(LogLevel level, const char* text);

  /**
   * Ask for the time; returns a number for `answered`. The bridge handles frames in order, so an answer says that
   * everything queued before has arrived: rosserial's only receipt.
   */
  uint32_t requestTime(uint64_t now);

  /** Whether that request was answered. */
  bool answered(uint32_t request) const { return answers_ >= request; }

  /** Whether the bridge has sent the time. */
  bool knowsTime() const { return knows_time_; }

  /** The bridge's time [ms since 1970]; it lags by the answer's travel time. */
  uint64_t bridgeTime(uint64_t now) const { return bridge_time_ + (now - bridge_time_at_); }

  /** Bytes to send, and how many. */
  const uint8_t* output() const { return output_; }
  size_t outputSize() const { return output_size_; }

  /** Remove the first bytes of the output, which have been sent. */
  void sent(size_t count);

  /** Bytes of all connections that were not part of a frame. */
  uint32_t garbage() const { return parser_.garbage(); }

 private:
  void frame(const Frame& frame, uint64_t now);
  void topicsAsked(uint64_t now);
  void timeTold(const Frame& frame, uint64_t now);
  void challenged(const Frame& frame);
  void bridgeProof(const Frame& frame);
  bool put(uint16_t topic_id, const uint8_t* data, size_t size);
  void fail(const char* why);

  const Publisher publisher_;
  const Identity identity_;
  RandomSource& random_;
  FrameParser parser_;
  KeyProof proof_;
  SignedFrames from_sensor_;  // used once the bridge is proven
  SignedFrames from_bridge_;
  bool configured_ = false;
  bool challenged_ = false;
  bool proven_ = false;
  bool knows_time_ = false;
  const char* fault_ = nullptr;
  uint32_t requests_ = 0;
  uint32_t answers_ = 0;
  uint64_t last_bytes_ = 0;
  uint64_t last_request_ = 0;
  uint64_t last_answer_ = 0;
  uint64_t bridge_time_ = 0;
  uint64_t bridge_time_at_ = 0;
  uint64_t waiting_since_ = 0;
  uint8_t output_[512] = {0};
  size_t output_size_ = 0;
};

}  // namespace patrol
