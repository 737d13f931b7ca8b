"""`sweeper bench faults`: things that go wrong, and what the robot makes of them."""
