"""Dashboard: the robot in a browser, to see, to drive and to stop."""
