// Prints the frames that the firmware's parser finds in the bytes on stdin, "ID HEX" each, to compare it with Python's.
// usage: list_frames [PIECE]     PIECE: bytes given to the parser at a time
#include <stdio.h>
#include <stdlib.h>

#include <algorithm>
#include <vector>

#include "rosserial_frame.h"

int main(int count, char** values) {
  const size_t piece = count > 1 ? strtoul(values[1], nullptr, 10) : 64;
  std::vector<uint8_t> stream;
  for (int c = getchar(); c != EOF; c = getchar()) stream.push_back(static_cast<uint8_t>(c));
  patrol::FrameParser parser;
  patrol::Frame frame;
  for (size_t at = 0; at < stream.size();) {
    at += parser.write(stream.data() + at, std::min(piece, stream.size() - at));
    while (parser.next(&frame)) {
      printf("%u ", frame.topic_id);
      for (size_t i = 0; i < frame.size; ++i) printf("%02x", frame.data[i]);
      printf("\n");
    }
  }
  return 0;
}
