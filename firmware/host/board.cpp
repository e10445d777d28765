// Fakes of Arduino, FreeRTOS, Wi-Fi and watchdog, enough to run the sketch as a program.
#include <Arduino.h>
#include <WiFi.h>
#include <esp_random.h>
#include <esp_system.h>
#include <esp_task_wdt.h>
#include <husarnet.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "host.h"

using std::chrono::milliseconds;
using std::chrono::steady_clock;

/** A FreeRTOS task: a thread and its notification. */
struct tskTaskControlBlock {
  std::mutex mutex;
  std::condition_variable changed;
  uint32_t notifications = 0;
};

namespace {

std::atomic<bool> pin_high(false);
std::atomic<bool> wifi_up(true);
std::atomic<bool> wifi_begun(false);
std::atomic<void (*)()> interrupt_handler(nullptr);
std::atomic<int64_t> watchdog_fed(0);
std::atomic<int64_t> watchdog_timeout(0);
std::atomic<bool> watchdog_on(false);
thread_local tskTaskControlBlock* current_task = nullptr;

int64_t sinceStart() {
  static const steady_clock::time_point start = steady_clock::now();
  return std::chrono::duration_cast<milliseconds>(steady_clock::now() - start).count();
}

void give(tskTaskControlBlock* task) {
  const std::lock_guard<std::mutex> lock(task->mutex);
  ++task->notifications;
  task->changed.notify_one();
}

}  // namespace

namespace host {

Options& options() {
  static Options the_options;
  return the_options;
}

uint32_t boardMilliseconds() { return static_cast<uint32_t>(sinceStart()) + options().clock_offset; }

void setPin(bool high) {
  const bool before = pin_high.exchange(high);
  void (*const handler)() = interrupt_handler;
  if (high && !before && handler != nullptr) handler();
}

void setWifi(bool up) { wifi_up = up; }

bool watchdogStarved() { return watchdog_on && sinceStart() - watchdog_fed > watchdog_timeout; }

}  // namespace host

unsigned long millis() { return host::boardMilliseconds(); }
void pinMode(uint8_t, uint8_t) {}
int digitalRead(uint8_t) { return pin_high ? HIGH : LOW; }
void digitalWrite(uint8_t, uint8_t) {}
void attachInterrupt(uint8_t, void (*handler)(), int) { interrupt_handler = handler; }

HardwareSerial Serial;
size_t HardwareSerial::setTxBufferSize(size_t size) { return size; }
void HardwareSerial::begin(unsigned long) {}
int HardwareSerial::availableForWrite() { return 4096; }
size_t HardwareSerial::println(const char* line) {
  printf("%s\n", line);
  fflush(stdout);
  return strlen(line);
}

WiFiClass WiFi;
bool WiFiClass::mode(wifi_mode_t) { return true; }
void WiFiClass::persistent(bool) {}
bool WiFiClass::setSleep(bool) { return true; }
bool WiFiClass::setAutoReconnect(bool) { return true; }
wl_status_t WiFiClass::begin(const char*, const char*) {
  wifi_begun = true;
  return status();
}
#if HOST_IDF_MAJOR >= 5
bool WiFiClass::enableIPv6(bool) { return true; }
#else
bool WiFiClass::enableIpV6() { return true; }
#endif
bool WiFiClass::disconnect() { return true; }
wl_status_t WiFiClass::status() { return wifi_begun && wifi_up ? WL_CONNECTED : WL_DISCONNECTED; }

void HusarnetClient::join(const char*, const char*) {}
bool HusarnetClient::isJoined() { return true; }

uint32_t esp_random() {
  uint32_t value = 0;
  esp_fill_random(&value, sizeof(value));
  return value;
}
void esp_fill_random(void* data, size_t size) {
  if (getrandom(data, size, 0) != static_cast<ssize_t>(size)) perror("getrandom");
}

esp_reset_reason_t esp_reset_reason() { return host::options().after_reset ? ESP_RST_TASK_WDT : ESP_RST_POWERON; }

#if HOST_IDF_MAJOR >= 5
esp_err_t esp_task_wdt_init(const esp_task_wdt_config_t* config) { return esp_task_wdt_reconfigure(config); }
esp_err_t esp_task_wdt_reconfigure(const esp_task_wdt_config_t* config) {
  watchdog_timeout = config->timeout_ms;
  return ESP_OK;
}
#else
esp_err_t esp_task_wdt_init(uint32_t timeout_s, bool) {
  watchdog_timeout = static_cast<int64_t>(timeout_s) * 1000;
  return ESP_OK;
}
#endif
esp_err_t esp_task_wdt_add(TaskHandle_t) {
  watchdog_fed = sinceStart();
  watchdog_on = true;
  return ESP_OK;
}
esp_err_t esp_task_wdt_reset() {
  watchdog_fed = sinceStart();
  return ESP_OK;
}

TaskHandle_t xTaskGetCurrentTaskHandle() {
  static thread_local tskTaskControlBlock own;
  if (current_task == nullptr) current_task = &own;
  return current_task;
}
BaseType_t xTaskCreate(TaskFunction_t code, const char*, uint32_t, void* argument, UBaseType_t, TaskHandle_t* handle) {
  tskTaskControlBlock* const task = new tskTaskControlBlock;  // lives as long as the program
  if (handle != nullptr) *handle = task;
  std::thread([=] {
    current_task = task;
    code(argument);
  }).detach();
  return pdPASS;
}
void vTaskDelete(TaskHandle_t) {}  // the thread ends by returning
void vTaskDelay(TickType_t ticks) { std::this_thread::sleep_for(milliseconds(ticks)); }
uint32_t ulTaskNotifyTake(BaseType_t, TickType_t ticks) {
  tskTaskControlBlock* const task = xTaskGetCurrentTaskHandle();
  std::unique_lock<std::mutex> lock(task->mutex);
  const auto notified = [task] { return task->notifications > 0; };
  if (ticks == portMAX_DELAY) {
    task->changed.wait(lock, notified);
  } else {
    task->changed.wait_for(lock, milliseconds(ticks), notified);
  }
  const uint32_t count = task->notifications;
  task->notifications = 0;
  return count;
}
BaseType_t xTaskNotifyGive(TaskHandle_t task) {
  give(task);
  return pdPASS;
}
void vTaskNotifyGiveFromISR(TaskHandle_t task, BaseType_t* woken) {
  give(task);
  *woken = pdTRUE;
}
