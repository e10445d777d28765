// Framing: the byte vectors of rosserial, and streams that are cut, damaged and in pieces.
#include <algorithm>

#include "rosserial_frame.h"
#include "unit.h"

using unit::Bytes;
using unit::bytes;

namespace {

Bytes encoded(uint16_t id, const Bytes& data) {
  Bytes out(data.size() + patrol::kFrameOverhead);
  out.resize(patrol::encodeFrame(id, data.data(), data.size(), out.data(), out.size()));
  return out;
}

/** Frames that a parser finds in a stream given in pieces: "id:hex id:hex ". */
std::string parsed(patrol::FrameParser* parser, const Bytes& stream, size_t piece) {
  std::string found;
  patrol::Frame frame;
  for (size_t at = 0; at < stream.size();) {
    at += parser->write(stream.data() + at, std::min(piece, stream.size() - at));
    while (parser->next(&frame)) {
      found += std::to_string(frame.topic_id) + ":" + unit::hex(Bytes(frame.data, frame.data + frame.size)) + " ";
    }
  }
  return found;
}

std::string parsed(const Bytes& stream, size_t piece = 1000) {
  patrol::FrameParser parser;
  return parsed(&parser, stream, piece);
}

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

}  // namespace

TEST(frames_have_the_bytes_of_rosserial) {
  EQUAL(unit::hex(encoded(0, {})), "fffe0000ff0000ff");
  EQUAL(unit::hex(encoded(11, {})), "fffe0000ff0b00f4");
  EQUAL(unit::hex(encoded(125, {2, 1})), "fffe0200fd7d0002017f");
  EQUAL(unit::hex(encoded(10, Bytes(8, 0))), "fffe0800f70a000000000000000000f5");
}

TEST(frames_that_do_not_fit_are_not_written) {
  uint8_t out[9];
  const uint8_t data[2] = {1, 2};
  EQUAL(patrol::encodeFrame(125, data, 2, out, sizeof(out)), 0U);
  EQUAL(patrol::encodeFrame(125, data, 1, out, sizeof(out)), 9U);
  const Bytes huge(0x8000, 0);
  Bytes room(0x9000);
  EQUAL(patrol::encodeFrame(125, huge.data(), huge.size(), room.data(), room.size()), 0U);
}

TEST(frames_are_found_in_pieces_of_any_size) {
  const Bytes stream =
      encoded(0, {}) + encoded(10, Bytes(8, 7)) + encoded(8, Bytes(33, 0xff)) + encoded(300, Bytes(128, 0xfe));
  const std::string expected = parsed(stream);
  CHECK(expected.find("300:fefe") != std::string::npos);
  for (size_t piece = 1; piece < stream.size(); ++piece) EQUAL(parsed(stream, piece), expected);
}

TEST(garbage_costs_itself_only) {
  const Bytes good = encoded(10, Bytes(8, 3));
  const std::string expected = "10:0303030303030303 ";
  EQUAL(parsed(bytes("00 ff ff fe 12 34 ff") + good), expected);
  EQUAL(parsed(bytes("ff fe 08 00 f7 0a 00 01") + good), expected);  // truncated
  EQUAL(parsed(bytes("ff fe ff 7f 81") + good), expected);            // announces 32767 bytes
  EQUAL(parsed(bytes("ff") + good), expected);
  EQUAL(parsed(encoded(10, Bytes(129, 0)) + good), expected);         // longer than a sensor accepts
  Bytes wrong = good;
  wrong[9] = static_cast<uint8_t>(wrong[9] ^ 1);
  EQUAL(parsed(wrong + good), expected);
}

TEST(every_single_damaged_byte_loses_one_frame_at_most) {
  const Bytes good = encoded(10, Bytes(8, 3));
  for (size_t i = 0; i < good.size(); ++i) {
    for (int bit = 0; bit < 8; ++bit) {
      Bytes wrong = good;
      wrong[i] = static_cast<uint8_t>(wrong[i] ^ (1 << bit));
      const std::string found = parsed(wrong + good + good);
      EQUAL(std::count(found.begin(), found.end(), ':') >= 2, true);
    }
  }
}

TEST(a_stalled_frame_is_given_up_and_what_it_swallowed_is_found) {
  patrol::FrameParser parser;
  const Bytes good = encoded(0, {});
  EQUAL(parsed(&parser, bytes("ff fe 40 00 bf 0a 00") + good, 1000), "");
  CHECK(parser.pending());
  parser.giveUp();
  patrol::Frame frame;
  CHECK(parser.next(&frame));
  EQUAL(frame.topic_id, 0);
  EQUAL(parser.garbage(), 7U);
  CHECK(!parser.next(&frame));
  CHECK(!parser.pending());
  parser.giveUp();
  EQUAL(parser.garbage(), 7U);
}

TEST(a_new_connection_forgets_what_had_begun) {
  patrol::FrameParser parser;
  parsed(&parser, bytes("ff fe 40 00 bf 0a 00"), 1000);
  parser.clear();
  CHECK(!parser.pending());
  EQUAL(parsed(&parser, encoded(0, {}), 1000), "0: ");
}
