"""One file each: what the robot can do or show."""
