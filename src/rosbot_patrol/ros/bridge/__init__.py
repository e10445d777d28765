"""rosserial's serial_node: from motion sensors to ROS topics; and the virtual sensors."""
