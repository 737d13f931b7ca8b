"""`sweeper calibrate`, and the wizard that the running robot offers."""
