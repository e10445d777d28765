#include "key_proof.h"

#include <string.h>

namespace patrol {
namespace {

const char kSensorText[] = "rosbot_patrol sensor v2";
const char kBridgeText[] = "rosbot_patrol bridge v2";
const char kSessionText[] = "rosbot_patrol session v2";

void digest(const uint8_t* key, const char* text, size_t text_size, const uint8_t* first, size_t first_size,
            const uint8_t* second, size_t second_size, uint8_t sensor_id, uint8_t* out) {
  HmacSha256 hmac(key, kKeySize);
  hmac.update(text, text_size);
  hmac.update(first, first_size);
  hmac.update(second, second_size);
  hmac.update(&sensor_id, 1);
  hmac.finish(out);
}

int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

}  // namespace

bool KeyProof::answer(const uint8_t key[kKeySize], uint8_t sensor_id, const uint8_t* challenge, size_t size,
                      const uint8_t device_nonce[kDeviceNonceSize], uint8_t proof[kProofSize]) {
  asked_ = false;
  if (size != kChallengeSize || challenge[0] != kChallengeVersion) return false;
  const uint8_t* server_nonce = challenge + 1;
  proof[0] = kProofVersion;
  proof[1] = sensor_id;
  memcpy(proof + 2, device_nonce, kDeviceNonceSize);
  digest(key, kSensorText, sizeof(kSensorText) - 1, server_nonce, kServerNonceSize, device_nonce, kDeviceNonceSize,
         sensor_id, proof + 2 + kDeviceNonceSize);
  digest(key, kBridgeText, sizeof(kBridgeText) - 1, device_nonce, kDeviceNonceSize, server_nonce, kServerNonceSize,
         sensor_id, expected_);
  digest(key, kSessionText, sizeof(kSessionText) - 1, server_nonce, kServerNonceSize, device_nonce, kDeviceNonceSize,
         sensor_id, session_);
  asked_ = true;
  return true;
}

bool KeyProof::bridgeProves(const uint8_t* data, size_t size) const {
  return asked_ && size == kBridgeProofSize && data[0] == kProofVersion && sameDigest(data + 1, expected_);
}

bool parseKey(const char* hex, uint8_t key[kKeySize]) {
  if (strlen(hex) != 2 * kKeySize) return false;
  for (size_t i = 0; i < kKeySize; ++i) {
    const int high = hexDigit(hex[2 * i]);
    const int low = hexDigit(hex[2 * i + 1]);
    if (high < 0 || low < 0) return false;
    key[i] = static_cast<uint8_t>(high << 4 | low);
  }
  return true;
}

}  // namespace patrol
