// Stand-in for Husarnet's Arduino library.
#pragma once

class HusarnetClient {
 public:
  void join(const char* hostname, const char* join_code);
  bool isJoined();
};
