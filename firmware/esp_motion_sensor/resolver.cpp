#include "resolver.h"

#include <Arduino.h>
#include <string.h>

namespace patrol {
namespace {

constexpr uint32_t kStackSize = 4096;

void setPort(sockaddr_storage* storage, uint16_t port) {
  if (storage->ss_family == AF_INET) {
    reinterpret_cast<sockaddr_in*>(storage)->sin_port = htons(port);
  } else {
    reinterpret_cast<sockaddr_in6*>(storage)->sin6_port = htons(port);
  }
}

}  // namespace

void Resolver::begin() {
  figures_ = parseFigures();
  if (figures_) {
    state_.store(ResolverState::kKnown, std::memory_order_release);
    return;
  }
  TaskHandle_t handle = nullptr;
  xTaskCreate(&Resolver::task, "resolver", kStackSize, this, 1, &handle);
  task_ = handle;
}

void Resolver::ask() {
  if (figures_ || task_ == nullptr || !doubtful_ || state() == ResolverState::kAsking) return;
  doubtful_ = false;
  state_.store(ResolverState::kAsking, std::memory_order_release);
  xTaskNotifyGive(static_cast<TaskHandle_t>(task_));
}

void Resolver::task(void* self) {
  for (;;) {
    ulTaskNotifyTake(pdTRUE, portMAX_DELAY);
    static_cast<Resolver*>(self)->lookUp();
  }
}

bool Resolver::parseFigures() {
  memset(addresses_, 0, sizeof(addresses_));
  Address& first = addresses_[0];
  sockaddr_in* const v4 = reinterpret_cast<sockaddr_in*>(&first.storage);
  sockaddr_in6* const v6 = reinterpret_cast<sockaddr_in6*>(&first.storage);
  if (lwip_inet_pton(AF_INET, host_, &v4->sin_addr) == 1) {
    v4->sin_family = AF_INET;
    first.size = sizeof(sockaddr_in);
  } else if (lwip_inet_pton(AF_INET6, host_, &v6->sin6_addr) == 1) {
    v6->sin6_family = AF_INET6;
    first.size = sizeof(sockaddr_in6);
  } else {
    return false;
  }
  setPort(&first.storage, port_);
  count_ = 1;
  return true;
}

void Resolver::lookUp() {
  addrinfo hints = {};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (lwip_getaddrinfo(host_, nullptr, &hints, &found) != 0) {  // the earlier addresses are still worth a try
    state_.store(count_ > 0 ? ResolverState::kKnown : ResolverState::kFailed, std::memory_order_release);
    return;
  }
  count_ = 0;
  for (const addrinfo* each = found; each != nullptr && count_ < kMost; each = each->ai_next) {
    if (each->ai_addrlen > sizeof(sockaddr_storage)) continue;
    Address& next = addresses_[count_++];
    memset(&next, 0, sizeof(next));
    memcpy(&next.storage, each->ai_addr, each->ai_addrlen);
    next.size = each->ai_addrlen;
    setPort(&next.storage, port_);
  }
  lwip_freeaddrinfo(found);
  state_.store(count_ > 0 ? ResolverState::kKnown : ResolverState::kFailed, std::memory_order_release);
}

}  // namespace patrol
