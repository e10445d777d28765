// The sketch as a program: real sockets; its pin and faults are controlled by lines on stdin.
//
//   motion 0|1   the PIR's output; on 1 it prints "edge NANOSECONDS" (CLOCK_MONOTONIC) and calls the interrupt
//   spike MS     high for MS milliseconds
//   wifi 0|1     Wi-Fi down, up
//   cable 0|1    cut (packets vanish silently), plugged in
//   reset        restarts like the board: the bridge is not told, the connection stays open
//   break        the same in the middle of a frame
//   quit
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <thread>

#include "host.h"

void setup();
void loop();

namespace {

char** arguments = nullptr;

const option kOptions[] = {{"host", required_argument, nullptr, 'h'},     {"port", required_argument, nullptr, 'p'},
                           {"id", required_argument, nullptr, 'i'},       {"key", required_argument, nullptr, 'k'},
                           {"insist", no_argument, nullptr, 's'},         {"warm-up", required_argument, nullptr, 'w'},
                           {"max-age", required_argument, nullptr, 'a'},  {"clock", required_argument, nullptr, 'c'},
                           {"after-reset", no_argument, nullptr, 'r'},    {nullptr, 0, nullptr, 0}};

const char kUsage[] =
    "usage: esp_motion_sensor [--host NAME] [--port N] [--id N] [--key HEX [--insist]] [--warm-up MS] [--max-age MS]\n"
    "                         [--clock MS] [--after-reset]\n";

/** A number from an argument; ends the program if it is invalid or too large. */
uint32_t number(const char* text, uint32_t highest) {
  char* end = nullptr;
  const unsigned long value = strtoul(text, &end, 10);
  if (*text == '\0' || *text == '-' || *end != '\0' || value > highest) {
    fprintf(stderr, "expected a number up to %lu, got '%s'\n", static_cast<unsigned long>(highest), text);
    exit(2);
  }
  return static_cast<uint32_t>(value);
}

/** Runs before the sketch's global objects are constructed, because those read the options. */
__attribute__((constructor(101))) void readOptions(int count, char** values, char**) {
  arguments = values;
  host::Options& to = host::options();
  int which = 0;
  while ((which = getopt_long(count, values, "", kOptions, nullptr)) != -1) {
    switch (which) {
      case 'h': to.bridge = optarg; break;
      case 'p': to.port = static_cast<uint16_t>(number(optarg, 65535)); break;
      case 'i': to.id = static_cast<uint8_t>(number(optarg, 255)); break;
      case 'k': to.key = optarg; break;
      case 's': to.insist = true; break;
      case 'w': to.warm_up = number(optarg, 0xffffffffU); break;
      case 'a': to.max_age = number(optarg, 0xffffffffU); break;
      case 'c': to.clock_offset = number(optarg, 0xffffffffU); break;
      case 'r': to.after_reset = true; break;
      default: fputs(kUsage, stderr); exit(2);
    }
  }
}

void sayEdge() {
  timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  printf("edge %lld\n", static_cast<long long>(now.tv_sec) * 1000000000LL + now.tv_nsec);
  fflush(stdout);
}

[[noreturn]] void startAnew() {
  char* values[32];
  size_t count = 0;
  for (char** each = arguments; *each != nullptr && count < 30; ++each) {
    if (strcmp(*each, "--after-reset") != 0) values[count++] = *each;
  }
  static char after_reset[] = "--after-reset";
  values[count++] = after_reset;
  values[count] = nullptr;
  execv("/proc/self/exe", values);  // sockets stay open: a board's reset closes nothing either
  perror("execv");
  _exit(1);
}

void obey(const char* line) {
  unsigned value = 0;
  if (sscanf(line, "motion %u", &value) == 1) {
    if (value != 0) sayEdge();
    host::setPin(value != 0);
  } else if (sscanf(line, "spike %u", &value) == 1) {
    host::setPin(true);
    usleep(value * 1000);
    host::setPin(false);
  } else if (sscanf(line, "wifi %u", &value) == 1) {
    host::setWifi(value != 0);
  } else if (sscanf(line, "cable %u", &value) == 1) {
    host::cutCable(value == 0);
  } else if (strcmp(line, "reset\n") == 0) {
    startAnew();
  } else if (strcmp(line, "break\n") == 0) {
    host::stopInMidFrame();
    startAnew();
  } else if (strcmp(line, "quit\n") == 0) {
    _exit(0);
  } else {
    fprintf(stderr, "unknown command: %s", line);
  }
}

/** Unbuffered reader, so that a restart loses no line. */
void listen() {
  char line[128];
  size_t filled = 0;
  char c = 0;
  while (read(STDIN_FILENO, &c, 1) == 1) {
    if (filled + 2 < sizeof(line)) line[filled++] = c;
    if (c != '\n') continue;
    line[filled] = '\0';
    filled = 0;
    obey(line);
  }
  _exit(0);  // the parent process has gone
}

}  // namespace

int main() {
  std::thread(listen).detach();
  setup();
  while (!host::watchdogStarved()) loop();
  fputs("the watchdog bites\n", stderr);
  return 3;
}
