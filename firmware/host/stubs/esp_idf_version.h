// Stand-in for ESP-IDF's version: 4 below Arduino core 2, 5 below core 3.
#pragma once

#define ESP_IDF_VERSION_MAJOR HOST_IDF_MAJOR
