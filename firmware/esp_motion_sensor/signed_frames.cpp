#include "signed_frames.h"

#include <string.h>

namespace patrol {

void SignedFrames::begin(const uint8_t session[kDigestSize], const char* direction) {
  HmacSha256 hmac(session, kDigestSize);
  hmac.update(direction, strlen(direction));
  hmac.finish(key_);
  count_ = 0;
}

void SignedFrames::sign(uint16_t topic_id, const uint8_t* data, size_t size,
                        uint8_t signature[kSignatureSize]) const {
  const uint8_t head[6] = {
      static_cast<uint8_t>(topic_id),     static_cast<uint8_t>(topic_id >> 8), static_cast<uint8_t>(count_),
      static_cast<uint8_t>(count_ >> 8),  static_cast<uint8_t>(count_ >> 16),  static_cast<uint8_t>(count_ >> 24),
  };
  uint8_t digest[kDigestSize];
  HmacSha256 hmac(key_, sizeof(key_));
  hmac.update(head, sizeof(head));
  hmac.update(data, size);
  hmac.finish(digest);
  memcpy(signature, head + 2, 4);
  memcpy(signature + 4, digest, kTagSize);
}

bool SignedFrames::isNext(uint16_t topic_id, const uint8_t* payload, size_t size) const {
  if (size < kSignatureSize) return false;
  uint8_t expected[kSignatureSize];
  sign(topic_id, payload, size - kSignatureSize, expected);
  uint8_t difference = 0;  // in a time that tells nothing of where they differ
  for (size_t i = 0; i < kSignatureSize; ++i) {
    difference = static_cast<uint8_t>(difference | (expected[i] ^ payload[size - kSignatureSize + i]));
  }
  return difference == 0;
}

}  // namespace patrol
