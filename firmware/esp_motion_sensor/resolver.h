// Host names to addresses, in a task of its own: lwIP's look-up blocks, and the sensor must not.
#pragma once

#include <lwip/netdb.h>
#include <lwip/sockets.h>
#include <stdint.h>

#include <atomic>

namespace patrol {

/** A socket address of either family. */
struct Address {
  sockaddr_storage storage;
  socklen_t size;
};

enum class ResolverState : uint8_t { kAsking, kKnown, kFailed };

/** Look up one name; a numeric IPv4 or IPv6 address needs no look-up, and then no task is started. */
class Resolver {
 public:
  Resolver(const char* host, uint16_t port) : host_(host), port_(port) {}

  void begin();

  /** Look the name up unless it is known and not in doubt. */
  void ask();

  ResolverState state() const { return state_.load(std::memory_order_acquire); }

  /** One of the addresses, in turn; only while `state` is kKnown. */
  const Address& address(unsigned index) const { return addresses_[index % count_]; }

  /** Report that the address did not answer: the name is looked up again next time. */
  void doubt() { doubtful_ = true; }

 private:
  static void task(void* self);
  bool parseFigures();
  void lookUp();

  static constexpr unsigned kMost = 4;
  const char* const host_;
  const uint16_t port_;
  bool figures_ = false;
  bool doubtful_ = true;
  void* task_ = nullptr;
  Address addresses_[kMost];
  unsigned count_ = 0;
  std::atomic<ResolverState> state_{ResolverState::kFailed};
};

}  // namespace patrol
