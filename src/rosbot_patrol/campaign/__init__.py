"""Campaigns: many seeded patrols of simulated houses, compared with ground truth."""
