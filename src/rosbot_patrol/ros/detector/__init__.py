"""The node darknet_ros, and the nodes and programs around its pictures."""
