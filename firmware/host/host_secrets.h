// secrets.h of the host build: the settings are the program's arguments.
#pragma once

#include "host.h"

#define WIFI_SSID "host"
#define WIFI_PASSWORD "host"
#define BRIDGE_HOST (host::options().bridge)
#define BRIDGE_PORT (host::options().port)
#define SENSOR_ID (host::options().id)
#define SENSOR_KEY (host::options().key)
#define INSIST_ON_KEY (host::options().insist)
#define WARM_UP_MS (host::options().warm_up)
#define TRIGGER_MAX_AGE_MS (host::options().max_age)
