"""The robot, seen and steered from outside: a process of its own that may crash freely."""
