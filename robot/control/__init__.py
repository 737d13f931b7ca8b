"""From a path to wheel commands, and the one gate that every command passes."""
