"""Localization: the pose in the map, by odometry and fixes of other sources."""
