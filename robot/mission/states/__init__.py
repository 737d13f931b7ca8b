"""What the robot can be about, one state a file."""
