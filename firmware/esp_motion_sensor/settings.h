// The settings of this sensor: secrets.h, with defaults for missing values.
#pragma once

#if defined(PATROL_SECRETS_FILE)
#include PATROL_SECRETS_FILE
#else
#if defined(__has_include)
#if !__has_include("secrets.h")
#error "secrets.h is missing: copy secrets.example.h to secrets.h and fill it in"
#endif
#endif
#include "secrets.h"
#endif

#ifndef WIFI_SSID
#error "secrets.h does not define WIFI_SSID"
#endif
#ifndef BRIDGE_HOST
#error "secrets.h does not define BRIDGE_HOST: the address of the computer that runs serial_node.py"
#endif
#ifndef SENSOR_ID
#error "secrets.h does not define SENSOR_ID: the number of the room that this sensor watches"
#endif

#ifndef WIFI_PASSWORD
#define WIFI_PASSWORD ""
#endif
#ifndef BRIDGE_PORT
#define BRIDGE_PORT 11411
#endif
#ifndef SENSOR_KEY
#define SENSOR_KEY ""
#endif
#ifndef INSIST_ON_KEY
#define INSIST_ON_KEY false
#endif
#ifndef PIR_PIN
#define PIR_PIN 27
#endif
#ifndef LED_PIN
#define LED_PIN 2  // the blue one of most boards; -1 for none
#endif
#ifndef USE_HUSARNET
#define USE_HUSARNET 0
#endif
#ifndef TOPIC
#define TOPIC "motion_trigger"
#endif
#ifndef TOPIC_TYPE
#define TOPIC_TYPE "rosbot_patrol/EspTrigger"  // or "rosbot_patrol_simulation/EspTrigger", of the same definition
#endif
#ifndef WARM_UP_MS
#define WARM_UP_MS 60000
#endif
#ifndef CONFIRM_MS
#define CONFIRM_MS 5
#endif
#ifndef RELEASE_MS
#define RELEASE_MS 50
#endif
#ifndef STUCK_MS
#define STUCK_MS 600000
#endif
#ifndef HEARTBEAT_MS
#define HEARTBEAT_MS 500
#endif
#ifndef TRIGGER_MAX_AGE_MS
#define TRIGGER_MAX_AGE_MS 60000
#endif
#ifndef WATCHDOG_S
#define WATCHDOG_S 10
#endif

#include "motion_sensor.h"

#ifndef PATROL_HOST  // there the settings are arguments of the program
static_assert(SENSOR_ID >= 0 && SENSOR_ID <= 255, "SENSOR_ID is one byte");
static_assert(sizeof(SENSOR_KEY) == 1 || sizeof(SENSOR_KEY) == 65, "SENSOR_KEY has 64 hexadecimal digits, or none");
#endif

namespace patrol {

// MD5 of the message "uint8 id / bool move", and the id that rosserial's NodeHandle gives to the first publisher of a
// board with 25 subscribers (100 + 25).
constexpr char kEspTriggerMd5[] = "95f4bf9b776b2424e3a9da1182e3a9d2";
constexpr uint16_t kPublisherId = 125;

/** The sensor's settings; `key` is null or the parsed SENSOR_KEY. */
inline SensorConfig sensorConfig(const uint8_t* key) {
  SensorConfig config = {};
  config.publisher = {kPublisherId, TOPIC, TOPIC_TYPE, kEspTriggerMd5, 512};
  config.identity = {static_cast<uint8_t>(SENSOR_ID), key, INSIST_ON_KEY};
  config.motion = {WARM_UP_MS, CONFIRM_MS, RELEASE_MS, STUCK_MS};
  config.heartbeat = HEARTBEAT_MS;
  config.trigger_max_age = TRIGGER_MAX_AGE_MS;
  return config;
}

}  // namespace patrol
