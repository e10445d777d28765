// SHA-256 (FIPS 180-4) and HMAC-SHA256 (RFC 2104): one implementation for board and host, without heap.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace patrol {

constexpr size_t kDigestSize = 32;
constexpr size_t kHashBlock = 64;

/** SHA-256 over bytes that come in pieces. */
class Sha256 {
 public:
  Sha256();
  void update(const void* data, size_t size);
  void finish(uint8_t digest[kDigestSize]);

 private:
  void block(const uint8_t* data);

  uint32_t state_[8];
  uint8_t buffer_[kHashBlock];
  uint64_t length_ = 0;  // bytes so far
};

/** HMAC-SHA256 over bytes that come in pieces; the key may have any length. */
class HmacSha256 {
 public:
  HmacSha256(const void* key, size_t size);
  void update(const void* data, size_t size) { inner_.update(data, size); }
  void finish(uint8_t digest[kDigestSize]);

 private:
  Sha256 inner_;
  Sha256 outer_;
};

/** Compare two digests in constant time. */
bool sameDigest(const uint8_t* a, const uint8_t* b);

}  // namespace patrol
