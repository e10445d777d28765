"""Reader of Gazebo's world and model files (SDF)."""
