"""TrajectoryPlannerROS and DWAPlannerROS: velocities that follow a plan."""
