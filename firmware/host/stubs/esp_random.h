// Stand-in for ESP-IDF's random numbers.
#pragma once

#include <stddef.h>
#include <stdint.h>

uint32_t esp_random();
void esp_fill_random(void* data, size_t size);
