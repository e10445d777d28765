// A motion sensor of rosbot_patrol: ESP32 and HC-SR501. Wiring, flashing and settings: ../README.md
//
// Copy secrets.example.h to secrets.h and fill it in. There is nothing else to install.

#include "esp32_board.h"
#include "key_proof.h"
#include "motion_sensor.h"
#include "settings.h"
#include "tcp_link.h"

namespace {

uint8_t key[patrol::kKeySize];
const bool has_key = SENSOR_KEY[0] != '\0';
const bool key_is_good = patrol::parseKey(SENSOR_KEY, key);

patrol::Esp32Board board(PIR_PIN, LED_PIN);
patrol::TcpLink bridge_link(BRIDGE_HOST, BRIDGE_PORT);
patrol::MotionSensor sensor(patrol::sensorConfig(key_is_good ? key : nullptr), board, bridge_link);

}  // namespace

void setup() {
  board.begin(WATCHDOG_S);
  if (has_key && !key_is_good) board.log("SENSOR_KEY is not 64 hexadecimal digits: this sensor has no key");
  bridge_link.begin();
  sensor.begin();
}

void loop() {
  sensor.step();
  board.rest(sensor.restFor());
}
