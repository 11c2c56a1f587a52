"""The gateway to ROS 2 with independent peers, older versions of Zenoh, and its cost."""
