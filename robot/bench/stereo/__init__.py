"""`sweeper bench stereo`: matchers on pairs with true disparity."""
