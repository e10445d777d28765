"""rosserial's serial_node, which brings motion sensors to ROS topics, and virtual sensors."""
