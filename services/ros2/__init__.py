"""Gateway to ROS 2: topics, services and commands of rmw_zenoh, without ROS on the robot."""
