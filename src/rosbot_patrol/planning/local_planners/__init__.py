"""TrajectoryPlannerROS and DWAPlannerROS: the velocity that follows a plan."""
