"""GlobalPlanner and NavfnROS: the way over a costmap."""
