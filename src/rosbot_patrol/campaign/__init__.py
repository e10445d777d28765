"""Many seeded patrols of simulated houses, judged by what was really there."""
