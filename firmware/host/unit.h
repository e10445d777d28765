// A minimal test framework: TEST(name) { CHECK(...); EQUAL(a, b); }
#pragma once

#include <stdint.h>

#include <sstream>
#include <string>
#include <vector>

namespace unit {

struct Test {
  const char* name;
  void (*body)();
};

std::vector<Test>& tests();
void fail(const char* file, int line, const std::string& what);

struct Registered {
  Registered(const char* name, void (*body)()) { tests().push_back({name, body}); }
};

using Bytes = std::vector<uint8_t>;

/** Bytes from hexadecimal digits and blanks. */
Bytes bytes(const std::string& hex);
std::string hex(const Bytes& data);

template <typename A, typename B>
void equal(const A& found, const B& expected, const char* text, const char* file, int line) {
  if (found == expected) return;
  std::ostringstream what;
  what << text << " is " << found << ", expected " << expected;
  fail(file, line, what.str());
}

}  // namespace unit

#define TEST(name)                                               \
  static void test_##name();                                     \
  static const unit::Registered registered_##name(#name, test_##name); \
  static void test_##name()
#define CHECK(condition) \
  if (!(condition)) unit::fail(__FILE__, __LINE__, #condition)
#define EQUAL(found, expected) unit::equal((found), (expected), #found, __FILE__, __LINE__)
