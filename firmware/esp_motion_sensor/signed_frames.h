// Signed frames, after a proof of version 2: nobody between sensor and bridge can add, change or drop one.
//
// A payload is its data, a counter (32 bit LE, from 0 for each direction), and the first 8 bytes of the HMAC-SHA256 of
// topic id (16 bit LE), counter and data, under a key of the connection and the direction.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "sha256.h"

namespace patrol {

constexpr size_t kTagSize = 8;
constexpr size_t kSignatureSize = 4 + kTagSize;

/** One direction of a connection; both ends count its frames. */
class SignedFrames {
 public:
  /** Begin with the connection's key, at frame 0; `direction` names it. */
  void begin(const uint8_t session[kDigestSize], const char* direction);

  /** Write the signature of the next frame behind its data. */
  void sign(uint16_t topic_id, const uint8_t* data, size_t size, uint8_t signature[kSignatureSize]) const;

  /** Whether a payload is the next frame; its last `kSignatureSize` bytes are the signature. */
  bool isNext(uint16_t topic_id, const uint8_t* payload, size_t size) const;

  /** That frame was sent, or taken. */
  void advance() { ++count_; }

 private:
  uint8_t key_[kDigestSize] = {0};
  uint32_t count_ = 0;
};

}  // namespace patrol
