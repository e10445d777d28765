// Stand-in for the ESP32 core's Wi-Fi: up or down as the test sets it.
#pragma once

typedef enum { WL_IDLE_STATUS = 0, WL_CONNECTED = 3, WL_CONNECTION_LOST = 5, WL_DISCONNECTED = 6 } wl_status_t;
typedef enum { WIFI_STA = 1 } wifi_mode_t;

class WiFiClass {
 public:
  bool mode(wifi_mode_t mode);
  void persistent(bool keep);
  bool setSleep(bool sleep);
  bool setAutoReconnect(bool reconnect);
  wl_status_t begin(const char* ssid, const char* password);
  bool disconnect();
  wl_status_t status();
#if HOST_IDF_MAJOR >= 5
  bool enableIPv6(bool enable = true);
#else
  bool enableIpV6();
#endif
};
extern WiFiClass WiFi;
