#include "esp32_board.h"

#include <Arduino.h>
#include <WiFi.h>
#include <esp_idf_version.h>
#include <esp_system.h>
#include <esp_task_wdt.h>
#include <string.h>

#include <atomic>

#if __has_include(<esp_random.h>)
#include <esp_random.h>
#endif

#include "husarnet_task.h"
#include "settings.h"

namespace patrol {
namespace {

// Written by the interrupt, read by the loop.
std::atomic<bool> edge_seen(false);
std::atomic<uint32_t> edge_at(0);
TaskHandle_t loop_task = nullptr;

void IRAM_ATTR onRisingEdge() {
  if (!edge_seen.load(std::memory_order_acquire)) {
    edge_at.store(static_cast<uint32_t>(millis()), std::memory_order_relaxed);
    edge_seen.store(true, std::memory_order_release);
  }
  BaseType_t woken = pdFALSE;
  vTaskNotifyGiveFromISR(loop_task, &woken);
  if (woken == pdTRUE) portYIELD_FROM_ISR();
}

// An address in the house's own network needs IPv6 on Wi-Fi; Husarnet has its own interface.
bool wantsIpv6() { return !USE_HUSARNET && strchr(BRIDGE_HOST, ':') != nullptr; }

void startWatchdog(uint32_t timeout_s) {
#if ESP_IDF_VERSION_MAJOR >= 5
  esp_task_wdt_config_t config = {};
  config.timeout_ms = timeout_s * 1000;
  config.idle_core_mask = 0;  // this task only: Wi-Fi may keep the other core busy
  config.trigger_panic = true;
  if (esp_task_wdt_reconfigure(&config) != ESP_OK) esp_task_wdt_init(&config);
#else
  esp_task_wdt_init(timeout_s, true);
#endif
  esp_task_wdt_add(nullptr);
}

}  // namespace

void Esp32Board::begin(uint32_t watchdog_s) {
  Serial.setTxBufferSize(1024);  // so that a few lines at once do not wait for the port
  Serial.begin(115200);
  loop_task = xTaskGetCurrentTaskHandle();
  pinMode(static_cast<uint8_t>(pir_pin_), INPUT_PULLDOWN);  // a broken wire must not read as motion
  if (led_pin_ >= 0) pinMode(static_cast<uint8_t>(led_pin_), OUTPUT);
  attachInterrupt(digitalPinToInterrupt(static_cast<uint8_t>(pir_pin_)), onRisingEdge, RISING);
  startWatchdog(watchdog_s);
}

void Esp32Board::rest(uint32_t milliseconds) { ulTaskNotifyTake(pdTRUE, pdMS_TO_TICKS(milliseconds)); }

uint32_t Esp32Board::milliseconds() { return static_cast<uint32_t>(millis()); }

uint32_t Esp32Board::random() { return esp_random(); }

void Esp32Board::fill(uint8_t* data, size_t size) { esp_fill_random(data, size); }  // true noise while Wi-Fi is on

bool Esp32Board::poweredOn() {
  const esp_reset_reason_t reason = esp_reset_reason();
  return reason == ESP_RST_POWERON || reason == ESP_RST_BROWNOUT || reason == ESP_RST_UNKNOWN;
}

bool Esp32Board::motionLevel() { return digitalRead(static_cast<uint8_t>(pir_pin_)) == HIGH; }

bool Esp32Board::takeEdge(uint32_t* at) {
  if (!edge_seen.load(std::memory_order_acquire)) return false;
  *at = edge_at.load(std::memory_order_relaxed);
  edge_seen.store(false, std::memory_order_release);
  return true;
}

void Esp32Board::setLed(bool on) {
  if (led_pin_ < 0 || on == led_on_) return;
  led_on_ = on;
  digitalWrite(static_cast<uint8_t>(led_pin_), on ? HIGH : LOW);
}

void Esp32Board::log(const char* line) {
  // The serial port must not block the loop either: text beyond its buffer is dropped.
  if (Serial.availableForWrite() > static_cast<int>(strlen(line)) + 2) Serial.println(line);
}

void Esp32Board::feedWatchdog() { esp_task_wdt_reset(); }

void Esp32Board::joinNetwork() {
  if (wifi_begun_) {
    WiFi.disconnect();
  } else {
    wifi_begun_ = true;
    WiFi.persistent(false);  // do not wear out the flash
    WiFi.mode(WIFI_STA);
    WiFi.setSleep(false);  // in sleep mode it would receive the bridge's data up to 0.3 s late
    WiFi.setAutoReconnect(true);
#if ESP_IDF_VERSION_MAJOR >= 5  // Arduino core 3; core 2 wants it once Wi-Fi is up
    if (wantsIpv6()) WiFi.enableIPv6();
#endif
  }
  WiFi.begin(WIFI_SSID, WIFI_PASSWORD);
}

bool Esp32Board::networkUp() {
  const bool up = WiFi.status() == WL_CONNECTED;
#if ESP_IDF_VERSION_MAJOR < 5
  if (up && !wifi_was_up_ && wantsIpv6()) WiFi.enableIpV6();
#endif
  wifi_was_up_ = up;
  if (!up) return false;
  startHusarnet();
  return husarnetJoined();
}

}  // namespace patrol
