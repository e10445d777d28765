#include "husarnet_task.h"

#include "settings.h"

#if USE_HUSARNET

#include <Arduino.h>
#include <husarnet.h>

#include <atomic>

#ifndef HUSARNET_JOIN_CODE
#error "USE_HUSARNET needs HUSARNET_JOIN_CODE and HUSARNET_NAME in secrets.h"
#endif

namespace patrol {
namespace {

constexpr uint32_t kStackSize = 16384;
HusarnetClient husarnet;
std::atomic<bool> joined(false);
bool started = false;

void join(void*) {
  husarnet.join(HUSARNET_NAME, HUSARNET_JOIN_CODE);
  while (!husarnet.isJoined()) vTaskDelay(pdMS_TO_TICKS(200));
  joined = true;
  vTaskDelete(nullptr);
}

}  // namespace

void startHusarnet() {
  if (started) return;
  started = true;
  xTaskCreate(join, "husarnet_join", kStackSize, nullptr, 1, nullptr);
}

bool husarnetJoined() { return joined; }

}  // namespace patrol

#else

namespace patrol {

void startHusarnet() {}
bool husarnetJoined() { return true; }

}  // namespace patrol

#endif
