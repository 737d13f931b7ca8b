"""What the robot is about: a small explicit state machine, one file per state."""
