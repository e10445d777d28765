"""Campaigns: many seeded patrols of a simulated house, each judged against what really was there."""
