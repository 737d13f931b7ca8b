"""Between a running robot and the people who ask, watch and steer it, over one socket."""
