"""`sweeper check`: is this machine ready to drive?"""
