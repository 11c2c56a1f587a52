"""Two hosts and the air between them: what the operator has of it, and what the robot."""
