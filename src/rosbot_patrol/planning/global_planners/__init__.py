"""GlobalPlanner and NavfnROS: plans over a costmap."""
