"""serial_node, the bridge from motion sensors to ROS topics; and virtual sensors."""
