// The pre-shared key: mutual proof of identity between sensor and bridge, before anything is negotiated.
//
// The bridge sends frame 8 (01 | 32 random bytes), the sensor answers frame 9 (02 | its id | 16 random bytes | HMAC),
// and the bridge answers frame 9 (02 | HMAC). Each HMAC is SHA-256 over its own text, both nonces and the id. Version 02
// says that all later frames are signed (signed_frames.h); 01 was that of older firmware, without.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "sha256.h"

namespace patrol {

constexpr size_t kKeySize = 32;
constexpr size_t kServerNonceSize = 32;
constexpr size_t kDeviceNonceSize = 16;
constexpr uint8_t kChallengeVersion = 1;
constexpr uint8_t kProofVersion = 2;
constexpr size_t kChallengeSize = 1 + kServerNonceSize;
constexpr size_t kProofSize = 1 + 1 + kDeviceNonceSize + kDigestSize;
constexpr size_t kBridgeProofSize = 1 + kDigestSize;

/** One exchange, with the data to check the bridge's answer. */
class KeyProof {
 public:
  /** Answer a challenge (the 33 bytes of its frame); false if it is not of this version. */
  bool answer(const uint8_t key[kKeySize], uint8_t sensor_id, const uint8_t* challenge, size_t size,
              const uint8_t device_nonce[kDeviceNonceSize], uint8_t proof[kProofSize]);

  /** Whether the bridge's answer proves that it knows the key; false without a challenge before it. */
  bool bridgeProves(const uint8_t* data, size_t size) const;

  /** Key of the connection, once a challenge was answered. */
  const uint8_t* session() const { return session_; }

  /** Forget the exchange, for a new connection. */
  void clear() { asked_ = false; }

 private:
  uint8_t expected_[kDigestSize] = {0};
  uint8_t session_[kDigestSize] = {0};
  bool asked_ = false;
};

/** A key from 64 hexadecimal digits; false for anything else. */
bool parseKey(const char* hex, uint8_t key[kKeySize]);

}  // namespace patrol
