// lwIP's calls through the host's sockets, with a cable that can be cut.
#include <errno.h>
#include <fcntl.h>
#include <lwip/netdb.h>
#include <lwip/sockets.h>
#include <unistd.h>

#include <atomic>
#include <map>
#include <vector>

#include "host.h"

namespace {

std::atomic<bool> cut(false);
std::atomic<bool> half(false);
std::atomic<bool> half_done(false);

// Data that the stack holds back while no packet gets through, and sends later; used by the loop's thread only.
constexpr size_t kSendBuffer = 5744;
std::map<int, std::vector<char>> held;

int wouldWait() {
  errno = EAGAIN;
  return -1;
}

ssize_t hold(int socket, const void* data, size_t size) {
  std::vector<char>& buffer = held[socket];
  if (buffer.size() + size > kSendBuffer) return wouldWait();
  const char* const bytes = static_cast<const char*>(data);
  buffer.insert(buffer.end(), bytes, bytes + size);
  return static_cast<ssize_t>(size);
}

/** Send the data held back; false if that is impossible. */
bool release(int socket, int flags) {
  const auto buffer = held.find(socket);
  if (buffer == held.end()) return true;
  const std::vector<char> bytes = buffer->second;
  held.erase(buffer);
  return send(socket, bytes.data(), bytes.size(), flags) == static_cast<ssize_t>(bytes.size());
}

}  // namespace

namespace host {

void cutCable(bool is_cut) { cut = is_cut; }

void stopInMidFrame() {
  half = true;
  while (!half_done) usleep(1000);
}

}  // namespace host

int lwip_socket(int family, int type, int protocol) { return socket(family, type, protocol); }
int lwip_connect(int socket, const sockaddr* address, socklen_t size) {
  if (!cut) return connect(socket, address, size);
  errno = EINPROGRESS;
  return -1;
}
int lwip_fcntl(int socket, int command, int value) { return fcntl(socket, command, value); }
int lwip_select(int highest, fd_set* readable, fd_set* writable, fd_set* failed, timeval* timeout) {
  return cut ? 0 : select(highest, readable, writable, failed, timeout);
}
int lwip_setsockopt(int socket, int level, int option, const void* value, socklen_t size) {
  return setsockopt(socket, level, option, value, size);
}
int lwip_getsockopt(int socket, int level, int option, void* value, socklen_t* size) {
  return getsockopt(socket, level, option, value, size);
}
ssize_t lwip_recv(int socket, void* data, size_t size, int flags) {
  return cut ? wouldWait() : recv(socket, data, size, flags);
}
ssize_t lwip_send(int socket, const void* data, size_t size, int flags) {
  if (half_done) return wouldWait();
  if (half && size > 1) {
    half_done = true;
    return send(socket, data, size / 2, flags);
  }
  if (cut) return hold(socket, data, size);
  return release(socket, flags) ? send(socket, data, size, flags) : -1;
}
int lwip_close(int socket) {
  held.erase(socket);
  // With the cable cut no FIN reaches the bridge: the socket stays open until the program ends.
  return cut ? 0 : close(socket);
}
int lwip_inet_pton(int family, const char* text, void* address) { return inet_pton(family, text, address); }

int lwip_getaddrinfo(const char* name, const char* service, const addrinfo* hints, addrinfo** found) {
  return getaddrinfo(name, service, hints, found);
}
void lwip_freeaddrinfo(addrinfo* found) { freeaddrinfo(found); }
