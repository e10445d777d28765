"""Costmaps of layers: a map, what the lidar sees, and costs around both."""
