"""What the patrol's node does with its inputs, without ROS: keep the newest, refuse the stale, measure, assemble."""
