// Stand-in for ESP-IDF's task watchdog: version 4 (Arduino core 2) and version 5 (core 3) differ.
#pragma once

#include <stdint.h>

#include "freertos/task.h"

typedef int esp_err_t;
#define ESP_OK 0

#if HOST_IDF_MAJOR >= 5
typedef struct {
  uint32_t timeout_ms;
  uint32_t idle_core_mask;
  bool trigger_panic;
} esp_task_wdt_config_t;

esp_err_t esp_task_wdt_init(const esp_task_wdt_config_t* config);
esp_err_t esp_task_wdt_reconfigure(const esp_task_wdt_config_t* config);
#else
esp_err_t esp_task_wdt_init(uint32_t timeout_s, bool panic);
#endif
esp_err_t esp_task_wdt_add(TaskHandle_t task);
esp_err_t esp_task_wdt_reset();
