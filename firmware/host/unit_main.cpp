// Run the tests named on the command line, or all of them; exit status 1 after a failure.
#include <stdio.h>
#include <string.h>

#include "unit.h"

namespace {

bool failed = false;

}  // namespace

namespace unit {

std::vector<Test>& tests() {
  static std::vector<Test> all;
  return all;
}

void fail(const char* file, int line, const std::string& what) {
  failed = true;
  printf("%s:%d: %s\n", file, line, what.c_str());
}

Bytes bytes(const std::string& hex) {
  Bytes data;
  std::string digits;
  for (const char c : hex) {
    if (c != ' ') digits += c;
    if (digits.size() < 2) continue;
    data.push_back(static_cast<uint8_t>(std::stoul(digits, nullptr, 16)));
    digits.clear();
  }
  return data;
}

std::string hex(const Bytes& data) {
  std::string text;
  char two[3];
  for (const uint8_t byte : data) {
    snprintf(two, sizeof(two), "%02x", byte);
    text += two;
  }
  return text;
}

}  // namespace unit

int main(int count, char** names) {
  int failures = 0;
  int run = 0;
  for (const unit::Test& test : unit::tests()) {
    bool wanted = count < 2;
    for (int i = 1; i < count; ++i) wanted = wanted || strcmp(names[i], test.name) == 0;
    if (!wanted) continue;
    failed = false;
    test.body();
    ++run;
    if (failed) printf("FAILED %s\n", test.name);
    failures += failed ? 1 : 0;
  }
  printf("%d of %d tests failed\n", failures, run);
  return failures == 0 && run > 0 ? 0 : 1;
}
