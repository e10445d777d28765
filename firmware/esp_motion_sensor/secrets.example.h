// Copy this file to secrets.h and fill it in. secrets.h is not committed (.gitignore).
#pragma once

#define WIFI_SSID "your network"
#define WIFI_PASSWORD "its password"

// The computer that runs serial_node.py: an IPv4 or IPv6 address, or a name that DNS resolves. The port is that of
// esp_connector.launch (11411, 11412, 11413), or the same one for all sensors.
#define BRIDGE_HOST "192.168.1.10"
#define BRIDGE_PORT 11411

// The number of the room that this sensor watches, 0 to 255.
#define SENSOR_ID 1

// The key printed by `rosrun rosbot_patrol sensor_key ID`: 64 hexadecimal digits, different for each sensor.
// Without it the sensor proves nothing, and a bridge with keys refuses it.
// #define SENSOR_KEY "..."

// true: refuse a bridge that does not prove that it knows this key.
// #define INSIST_ON_KEY true

// #define PIR_PIN 27  // GPIO of the HC-SR501's output
// #define LED_PIN 2   // GPIO of the LED, -1 for none

// Husarnet: needs its Arduino library; BRIDGE_HOST is then the bridge's Husarnet address (fc94:...).
// #define USE_HUSARNET 1
// #define HUSARNET_NAME "sensor1"
// #define HUSARNET_JOIN_CODE "fc94:...:.../..."
