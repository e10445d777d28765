#include "tcp_link.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>

namespace patrol {
namespace {

/** Best effort: a link without the option still works. */
void setOption(int socket, int level, int option, int value) {
  lwip_setsockopt(socket, level, option, &value, sizeof(value));
}

bool wouldWait(int code) { return code == EAGAIN || code == EWOULDBLOCK || code == EINTR; }

}  // namespace

void TcpLink::dial() {
  hangUp();
  error_[0] = '\0';
  state_ = LinkState::kConnecting;
  resolver_.ask();
}

LinkState TcpLink::progress() {
  if (state_ != LinkState::kConnecting) return state_;
  if (socket_ < 0) {
    switch (resolver_.state()) {
      case ResolverState::kAsking:
        return state_;
      case ResolverState::kFailed:
        return failed("its name is unknown", 0);
      case ResolverState::kKnown:
        connectTo(resolver_.address(next_address_++));
        return state_;
    }
  }
  fd_set writable;
  FD_ZERO(&writable);
  FD_SET(socket_, &writable);
  timeval no_time = {0, 0};
  const int ready = lwip_select(socket_ + 1, nullptr, &writable, nullptr, &no_time);
  if (ready < 0) return failed("select", errno);
  if (ready == 0) return state_;
  int code = 0;
  socklen_t size = sizeof(code);
  if (lwip_getsockopt(socket_, SOL_SOCKET, SO_ERROR, &code, &size) != 0) code = errno;
  if (code != 0) return failed("connect", code);
  state_ = LinkState::kOpen;
  return state_;
}

int TcpLink::readSome(uint8_t* data, size_t room) {
  const ssize_t count = lwip_recv(socket_, data, room, MSG_DONTWAIT);
  if (count > 0) return static_cast<int>(count);
  if (count < 0 && wouldWait(errno)) return 0;
  failed(count == 0 ? "the bridge closed the connection" : "receive", count == 0 ? 0 : errno);
  return -1;
}

int TcpLink::writeSome(const uint8_t* data, size_t size) {
  const ssize_t count = lwip_send(socket_, data, size, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (count > 0) return static_cast<int>(count);
  if (count == 0 || wouldWait(errno)) return 0;
  failed("send", errno);
  return -1;
}

void TcpLink::hangUp() {
  if (socket_ >= 0) lwip_close(socket_);
  socket_ = -1;
  state_ = LinkState::kClosed;
}

void TcpLink::connectTo(const Address& address) {
  socket_ = lwip_socket(address.storage.ss_family, SOCK_STREAM, 0);
  if (socket_ < 0) {
    failed("socket", errno);
    return;
  }
  const int flags = lwip_fcntl(socket_, F_GETFL, 0);
  if (flags < 0 || lwip_fcntl(socket_, F_SETFL, flags | O_NONBLOCK) < 0) {
    failed("fcntl", errno);
    return;
  }
  setOption(socket_, IPPROTO_TCP, TCP_NODELAY, 1);  // send each frame at once, in its own segment
  const sockaddr* const where = reinterpret_cast<const sockaddr*>(&address.storage);
  if (lwip_connect(socket_, where, address.size) != 0 && errno != EINPROGRESS) failed("connect", errno);
}

LinkState TcpLink::failed(const char* what, int code) {
  if (code != 0) {
    snprintf(error_, sizeof(error_), "%s: %s", what, strerror(code));
  } else {
    snprintf(error_, sizeof(error_), "%s", what);
  }
  hangUp();
  resolver_.doubt();  // the bridge may have a new address
  return state_;
}

}  // namespace patrol
