"""What the robot keeps from day to day: its home, its books, its schedule."""
