// Fuzzer of the client with damaged conversations: it must never crash, never send an invalid frame, and never reveal
// its topics to a bridge without proof if it insists on one.
//
// usage: fuzz_client [INPUTS [SEED]]     mutated frames, by default 100000
// With clang and libFuzzer: clang++ -DPATROL_LIBFUZZER -fsanitize=fuzzer,address,undefined ... (see firmware/README.md)
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <algorithm>
#include <vector>

#include "rosserial_client.h"

namespace {

const uint8_t kKey[patrol::kKeySize] = {0x42};
constexpr patrol::Publisher kPublisher = {125, "motion_trigger", "rosbot_patrol/EspTrigger",
                                          "95f4bf9b776b2424e3a9da1182e3a9d2", 512};

struct Fixed final : patrol::RandomSource {
  void fill(uint8_t* data, size_t size) override { memset(data, 0x22, size); }
};

void must(bool good, const char* what) {
  if (good) return;
  fprintf(stderr, "violated: %s\n", what);
  abort();
}

/** Check that all sent bytes are complete frames. */
void drain(patrol::RosserialClient* client, patrol::FrameParser* sent) {
  must(client->outputSize() <= 512, "the output is bounded");
  patrol::Frame frame;
  while (client->outputSize() > 0) {
    client->sent(sent->write(client->output(), client->outputSize()));
    while (sent->next(&frame)) {
    }
  }
  must(sent->garbage() == 0, "only frames are sent");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const bool key = (data[0] & 1) != 0;
  const bool insist = (data[0] & 2) != 0;
  const size_t piece = 1 + (data[0] >> 4);
  Fixed random;
  patrol::RosserialClient client(kPublisher, {5, key ? kKey : nullptr, insist}, random);
  patrol::FrameParser sent;
  client.begin(0);
  const uint8_t message[2] = {5, 1};
  uint64_t now = 0;
  for (size_t at = 1; at < size; at += piece) {
    client.receive(data + at, std::min(piece, size - at), now);
    client.tick(now += data[at]);
    client.publish(message, sizeof(message));
    if (client.outputSize() > 300) drain(&client, &sent);
    must(!client.configured() || !insist || client.bridgeProven(), "who insists waits for the proof");
    if (client.fault() != nullptr) {
      must(!client.configured(), "a faulty connection is not used");
      client.begin(now);
      sent.clear();
    }
  }
  drain(&client, &sent);
  return 0;
}

#ifndef PATROL_LIBFUZZER
namespace {

using Bytes = std::vector<uint8_t>;

uint64_t state = 1;

uint32_t random32() {  // xorshift64*
  state ^= state >> 12;
  state ^= state << 25;
  state ^= state >> 27;
  return static_cast<uint32_t>(state * 2685821657736338717ULL >> 32);
}

uint32_t below(size_t limit) { return random32() % static_cast<uint32_t>(limit); }

void addFrame(Bytes* to) {
  static const uint16_t ids[] = {0, 0, 0, 8, 9, 10, 10, 11, 7, 6, 125, 1, 0xffff};
  static const size_t sizes[] = {0, 0, 0, 33, 33, 8, 8, 0, 20, 5, 2, 88, 40};
  const uint32_t which = below(sizeof(ids) / sizeof(ids[0]));
  Bytes data(below(8) == 0 ? below(140) : sizes[which]);
  for (uint8_t& byte : data) byte = static_cast<uint8_t>(below(4) == 0 ? 0xff : random32());
  if (!data.empty() && below(2) == 0) data[0] = 1;
  Bytes frame(data.size() + patrol::kFrameOverhead);
  patrol::encodeFrame(ids[which], data.data(), data.size(), frame.data(), frame.size());
  to->insert(to->end(), frame.begin(), frame.end());
}

Bytes conversation() {
  Bytes bytes{static_cast<uint8_t>(random32())};
  for (uint32_t frames = 1 + below(6); frames > 0; --frames) addFrame(&bytes);
  for (uint32_t changes = below(5); changes > 0; --changes) {
    const size_t at = below(bytes.size());
    const auto place = bytes.begin() + static_cast<Bytes::difference_type>(at);
    const size_t left = std::min<size_t>(9, bytes.size() - at);
    switch (below(4)) {
      case 0: bytes[at] = static_cast<uint8_t>(random32()); break;
      case 1: bytes.erase(place, place + static_cast<Bytes::difference_type>(below(left + 1))); break;
      case 2: bytes.insert(place, 1 + below(5), static_cast<uint8_t>(0xfe + below(2))); break;
      default: bytes[at] = static_cast<uint8_t>(bytes[at] ^ 1U << below(8)); break;
    }
    if (bytes.empty()) break;
  }
  return bytes;
}

}  // namespace

int main(int count, char** values) {
  const unsigned long inputs = count > 1 ? strtoul(values[1], nullptr, 10) : 100000;
  state = count > 2 ? strtoull(values[2], nullptr, 10) | 1 : 1;
  for (unsigned long i = 0; i < inputs; ++i) {
    const Bytes bytes = conversation();
    LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  }
  printf("%lu inputs\n", inputs);
  return 0;
}
#endif
