// The connection to the bridge through lwIP's sockets: IPv4 and IPv6, without blocking calls.
#pragma once

#include <stdint.h>

#include "hardware.h"
#include "resolver.h"

namespace patrol {

/** Connect to `host` (an address or a name) and `port`; a name's addresses are tried in turn. */
class TcpLink final : public Link {
 public:
  TcpLink(const char* host, uint16_t port) : resolver_(host, port) {}

  /** Start the task beside the loop: the look-up of a name. */
  void begin() { resolver_.begin(); }

  void dial() override;
  LinkState progress() override;
  int readSome(uint8_t* data, size_t room) override;
  int writeSome(const uint8_t* data, size_t size) override;
  void hangUp() override;
  const char* error() const override { return error_; }

 private:
  void connectTo(const Address& address);
  LinkState failed(const char* what, int code);

  Resolver resolver_;
  LinkState state_ = LinkState::kClosed;
  int socket_ = -1;
  unsigned next_address_ = 0;
  char error_[64] = "";
};

}  // namespace patrol
