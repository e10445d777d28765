"""The node rosserial's serial_node: motion sensors to ROS topics."""
