// Husarnet (optional, USE_HUSARNET): its join() waits for the network and for Husarnet's server, so it runs in a task
// of its own. Its addresses (fc94:...) are then reached through ordinary IPv6 sockets.
#pragma once

namespace patrol {

/** Join once Wi-Fi is up; may be called repeatedly. */
void startHusarnet();

/** Whether this board is part of the Husarnet network; true without Husarnet. */
bool husarnetJoined();

}  // namespace patrol
