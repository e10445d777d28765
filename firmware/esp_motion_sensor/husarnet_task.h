// Husarnet (optional, USE_HUSARNET): its join() waits for the network and for Husarnet's server, so a task of its own
// calls it. Its addresses (fc94:...) are then reached by ordinary IPv6 sockets.
#pragma once

namespace patrol {

/** Join once Wi-Fi is up; call it as often as you like. */
void startHusarnet();

/** Whether this board is part of the Husarnet network; true where it is not used. */
bool husarnetJoined();

}  // namespace patrol
