"""Whether the guard is on duty: arming, schedule, emergency stop, battery, neighbours."""
