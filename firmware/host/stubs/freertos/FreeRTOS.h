// Stand-in for FreeRTOS as the ESP32 configures it (1000 ticks a second).
#pragma once

#include <stdint.h>

typedef int BaseType_t;
typedef unsigned int UBaseType_t;
typedef uint32_t TickType_t;

#define pdTRUE 1
#define pdFALSE 0
#define pdPASS 1
#define portMAX_DELAY 0xffffffffU
#define pdMS_TO_TICKS(ms) static_cast<TickType_t>(ms)
#define portYIELD_FROM_ISR() static_cast<void>(0)
