// Stand-in for the ESP32 Arduino core: the functions that the sketch calls; board.cpp fakes them.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "freertos/FreeRTOS.h"
#include "freertos/task.h"

#define HIGH 0x1
#define LOW 0x0
#define INPUT 0x01
#define OUTPUT 0x03
#define INPUT_PULLDOWN 0x09
#define RISING 0x01
#define IRAM_ATTR
#define digitalPinToInterrupt(pin) (pin)

unsigned long millis();
void pinMode(uint8_t pin, uint8_t mode);
int digitalRead(uint8_t pin);
void digitalWrite(uint8_t pin, uint8_t level);
void attachInterrupt(uint8_t pin, void (*handler)(), int mode);

class HardwareSerial {
 public:
  size_t setTxBufferSize(size_t size);
  void begin(unsigned long baud);
  int availableForWrite();
  size_t println(const char* line);
};
extern HardwareSerial Serial;
