// The rosserial client: negotiation, time, key, and bridges that misbehave.
#include <string.h>

#include "rosserial_client.h"
#include "unit.h"

using patrol::RosserialClient;
using unit::Bytes;
using unit::bytes;

namespace {

constexpr patrol::Publisher kPublisher = {125, "motion_trigger", "rosbot_patrol/EspTrigger",
                                          "95f4bf9b776b2424e3a9da1182e3a9d2", 512};
const Bytes kKey(32, 0x42);
const char kTopics[] = "ff fe 00 00 ff 00 00 ff";
const char kTimeRequest[] = "fffe0800f70a000000000000000000f5";
const char kTopicInfo[] =
    "fffe5800a700007d000e0000006d6f74696f6e5f7472696767657218000000726f73626f745f706174726f6c2f45737054726967676572"
    "2000000039356634626639623737366232343234653361396461313138326533613964320002 0000d4";

struct Fixed final : patrol::RandomSource {
  void fill(uint8_t* data, size_t size) override { memset(data, 0x22, size); }
};

struct Peer {
  explicit Peer(bool key = false, bool insist = false)
      : client(kPublisher, {5, key ? kKey.data() : nullptr, insist}, random) {
    client.begin(0);
  }
  void tell(const Bytes& data, uint64_t now) { client.receive(data.data(), data.size(), now); }
  void tell(const std::string& hex, uint64_t now) { tell(bytes(hex), now); }
  std::string said() {
    const std::string text = unit::hex(Bytes(client.output(), client.output() + client.outputSize()));
    client.sent(client.outputSize());
    return text;
  }
  std::string fault() const { return client.fault() == nullptr ? "" : client.fault(); }

  Fixed random;
  RosserialClient client;
};

Bytes frame(uint16_t id, const Bytes& data) {
  Bytes out(data.size() + patrol::kFrameOverhead);
  patrol::encodeFrame(id, data.data(), data.size(), out.data(), out.size());
  return out;
}

Bytes challenge() {
  Bytes data(33, 0x11);
  data[0] = 1;
  return frame(8, data);
}

const char kBridgeProof[] = "02 3bda6f94d7a86a73d4b6692ea8e48fe279a180594880f7924cbf532de9a6e5b8";
const Bytes kSignedTopics = frame(0, bytes("00000000 eaca673a806cb10d"));
const Bytes kTime = frame(10, bytes("00 e1 f5 05 00 65 cd 1d"));  // 100000000.5 s

std::string spaceless(const char* text) { return unit::hex(bytes(text)); }

}  // namespace

TEST(a_topic_request_is_answered_as_rosserial_does) {
  Peer peer;
  EQUAL(peer.said(), "");
  CHECK(!peer.client.configured());
  peer.tell(kTopics, 10);
  EQUAL(peer.said(), kTimeRequest + spaceless(kTopicInfo));
  CHECK(peer.client.configured());
}

TEST(nothing_is_published_before_the_topics_are_known) {
  Peer peer;
  const uint8_t message[2] = {2, 1};
  CHECK(!peer.client.publish(message, 2));
  CHECK(!peer.client.log(patrol::LogLevel::kInfo, "text"));
  EQUAL(peer.said(), "");
  peer.tell(kTopics, 10);
  peer.said();
  CHECK(peer.client.publish(message, 2));
  EQUAL(peer.said(), "fffe0200fd7d0002017f");
  CHECK(peer.client.log(patrol::LogLevel::kWarn, "hi"));
  EQUAL(peer.said(), "fffe0700f807000202000000686923");
}

TEST(long_log_lines_and_a_full_output_are_refused_not_cut) {
  Peer peer;
  peer.tell(kTopics, 10);
  CHECK(!peer.client.log(patrol::LogLevel::kInfo, std::string(200, 'x').c_str()));
  const uint8_t message[2] = {2, 1};
  int queued = 0;
  while (peer.client.publish(message, 2)) ++queued;
  CHECK(queued > 30 && peer.client.outputSize() <= 512);
  const uint32_t receipt = peer.client.requestTime(11);
  CHECK(!peer.client.answered(receipt));  // the request could not be sent, so no earlier answer counts for it
  peer.tell(kTime, 12);
  CHECK(!peer.client.answered(receipt));
}

TEST(partly_sent_output_goes_on_where_it_stopped) {
  Peer peer;
  peer.tell(kTopics, 10);
  peer.client.sent(5);
  EQUAL(peer.said(), (kTimeRequest + spaceless(kTopicInfo)).substr(10));
}

TEST(time_is_asked_every_2500_ms_and_a_silent_bridge_is_left_after_11_s) {
  Peer peer;
  peer.tell(kTopics, 1000);
  peer.said();
  uint64_t now = 1000;
  while (peer.said().empty()) peer.client.tick(++now);
  EQUAL(now, 3501U);
  CHECK(!peer.client.knowsTime());
  peer.tell(kTime, 3600);
  CHECK(peer.client.knowsTime());
  EQUAL(peer.client.bridgeTime(3700), 100000000600U);
  for (now = 3600; peer.fault().empty(); ++now) peer.client.tick(now);
  EQUAL(now - 1, 3600U + 11001U);
  EQUAL(peer.fault(), "the bridge has not told the time for 11 s");
  CHECK(!peer.client.configured());
}

TEST(asking_for_topics_again_is_no_sign_of_life) {
  Peer peer;
  uint64_t now = 0;
  for (; peer.fault().empty() && now < 20000; now += 100) {
    peer.tell(kTopics, now);
    peer.client.tick(now);
    peer.said();
  }
  EQUAL(now, 11200U);
}

TEST(an_answer_is_a_receipt_for_what_was_sent_before_it) {
  Peer peer;
  peer.tell(kTopics, 10);
  const uint32_t receipt = peer.client.requestTime(20);
  CHECK(!peer.client.answered(receipt));
  peer.tell(kTime, 30);  // for the request of the negotiation
  CHECK(!peer.client.answered(receipt));
  peer.tell(kTime, 40);
  CHECK(peer.client.answered(receipt));
  peer.tell(kTime, 50);  // unrequested
  CHECK(!peer.client.answered(receipt + 1));
}

TEST(a_bridge_that_asks_for_nothing_is_left) {
  Peer peer;
  peer.client.tick(15000);
  EQUAL(peer.fault(), "");
  peer.client.tick(15001);
  EQUAL(peer.fault(), "the bridge asked for no topics for 15 s");
}

TEST(tx_stop_ends_the_traffic_until_topics_are_asked_for_again) {
  Peer peer;
  peer.tell(kTopics, 10);
  peer.tell("ff fe 00 00 ff 0b 00 f4", 20);
  CHECK(!peer.client.configured());
  EQUAL(peer.fault(), "");
  peer.said();
  peer.client.tick(9000);
  EQUAL(peer.said(), "");
  peer.tell(kTopics, 9001);
  CHECK(peer.client.configured());
}

TEST(after_tx_stop_the_bridge_has_15_s_to_ask_again) {
  Peer peer;
  peer.tell(kTopics, 10);
  peer.tell("ff fe 00 00 ff 0b 00 f4", 20000);
  peer.client.tick(35000);
  EQUAL(peer.fault(), "");
  peer.client.tick(35001);
  EQUAL(peer.fault(), "the bridge asked for no topics for 15 s");
}

TEST(unknown_ids_and_wrong_sizes_are_ignored) {
  Peer peer;
  peer.tell(kTopics, 10);
  peer.said();
  for (const int id : {1, 2, 3, 4, 5, 6, 7, 9, 12, 99, 100, 125, 126, 0xffff}) {
    for (const size_t size : {0, 1, 8, 33, 128}) peer.tell(frame(static_cast<uint16_t>(id), Bytes(size, 0x5a)), 20);
  }
  for (const size_t size : {0, 1, 7, 9, 128}) peer.tell(frame(10, Bytes(size, 0x5a)), 20);
  CHECK(!peer.client.knowsTime());
  CHECK(peer.client.configured());
  EQUAL(peer.fault() + peer.said(), "");
}

TEST(a_frame_that_stalls_is_given_up_after_a_second) {
  Peer peer;
  peer.tell("ff fe 40 00 bf 0a 00 ff fe 00 00 ff 00 00 ff", 10);
  CHECK(!peer.client.configured());
  peer.client.tick(1010);
  CHECK(!peer.client.configured());
  peer.client.tick(1011);
  CHECK(peer.client.configured());
}

TEST(a_new_connection_begins_from_nothing) {
  Peer peer;
  peer.tell(kTopics, 10);
  peer.tell("ff fe 40 00 bf", 20);
  peer.client.begin(30);
  CHECK(!peer.client.configured());
  EQUAL(peer.said(), "");
  peer.tell(kTopics, 40);
  EQUAL(peer.said(), kTimeRequest + spaceless(kTopicInfo));
}

TEST(the_key_is_proved_before_the_topics) {
  Peer peer(true);
  peer.tell(challenge(), 10);
  const std::string said = peer.said();
  EQUAL(said.substr(0, 14), "fffe3200cd0900");
  EQUAL(said.substr(14, 36), "0205" + std::string(32, '2'));
  EQUAL(said.size(), 2 * (50 + patrol::kFrameOverhead));
  CHECK(!peer.client.bridgeProven());
  peer.tell(frame(9, bytes(kBridgeProof)), 20);
  CHECK(peer.client.bridgeProven());
  EQUAL(peer.said(), "");
  peer.tell(kSignedTopics, 30);
  CHECK(peer.client.configured());
}

TEST(after_the_proof_each_frame_is_signed) {
  Peer peer(true, true);
  peer.tell(challenge(), 10);
  peer.tell(frame(9, bytes(kBridgeProof)), 20);
  peer.said();
  peer.tell(kSignedTopics, 30);
  const std::string said = peer.said();  // the time request is frame 0, the topic frame 1
  EQUAL(said.size(), 2 * (8 + 8 + 12) + spaceless(kTopicInfo).size() + 2 * 12);
  EQUAL(said.substr(2 * (7 + 8), 8), "00000000");
  const uint8_t message[2] = {5, 1};
  CHECK(peer.client.publish(message, 2));
  EQUAL(peer.said().substr(2 * 9, 8), "02000000");
}

TEST(what_somebody_adds_or_repeats_ends_the_connection) {
  for (const Bytes& wrong : {bytes(kTopics), kSignedTopics, frame(11, Bytes(12, 0)), frame(10, Bytes(20, 0))}) {
    Peer peer(true, true);
    peer.tell(challenge(), 10);
    peer.tell(frame(9, bytes(kBridgeProof)), 20);
    peer.tell(kSignedTopics, 30);
    CHECK(peer.client.configured());
    peer.tell(wrong, 40);
    EQUAL(peer.fault(), "somebody in between has changed what the bridge says");
    CHECK(!peer.client.configured());
  }
}

TEST(a_second_challenge_ends_the_connection) {
  Peer peer(true, true);
  peer.tell(challenge(), 10);
  peer.tell(frame(9, bytes(kBridgeProof)), 20);
  peer.tell(challenge(), 30);
  EQUAL(peer.fault(), "the bridge asks for the key a second time");
  peer.tell(kSignedTopics, 40);
  CHECK(!peer.client.configured());
}

TEST(a_wrong_proof_of_the_bridge_ends_the_connection) {
  Peer peer(true);
  peer.tell(challenge(), 10);
  Bytes wrong = bytes(kBridgeProof);
  wrong[5] = static_cast<uint8_t>(wrong[5] ^ 1);
  peer.tell(frame(9, wrong), 20);
  EQUAL(peer.fault(), "the bridge's proof is wrong: not our bridge, or another key");
}

TEST(who_insists_talks_to_no_bridge_without_proof) {
  Peer plain(true, true);
  plain.tell(kTopics, 10);
  EQUAL(plain.fault(), "the bridge has not proved that it knows the key, and this sensor insists on it");
  EQUAL(plain.said(), "");
  Peer half(true, true);
  half.tell(challenge(), 10);
  half.tell(kTopics, 20);
  CHECK(!half.fault().empty() && !half.client.configured());
  Peer whole(true, true);
  whole.tell(challenge(), 10);
  whole.tell(frame(9, bytes(kBridgeProof)), 20);
  whole.tell(kSignedTopics, 30);
  CHECK(whole.fault().empty() && whole.client.configured());
}

TEST(without_insisting_a_bridge_without_keys_will_do) {
  Peer peer(true);
  peer.tell(frame(9, bytes(kBridgeProof)), 5);  // unrequested
  CHECK(!peer.client.bridgeProven());
  peer.tell(kTopics, 10);
  CHECK(peer.client.configured());
}

TEST(a_sensor_without_key_says_what_is_missing) {
  Peer peer;
  peer.tell(challenge(), 10);
  CHECK(peer.fault().find("SENSOR_KEY") != std::string::npos);
  EQUAL(peer.said(), "");
}

TEST(a_challenge_of_another_version_is_told) {
  Peer peer(true);
  peer.tell(frame(8, Bytes(33, 2)), 10);
  EQUAL(peer.fault(), "the bridge's challenge is of an unknown version");
  EQUAL(peer.said(), "");
}
