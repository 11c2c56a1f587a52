"""The gateway to ROS 2 with independent peers and older versions of Zenoh."""
