"""The serial bridge to the motor controller, and the controller's firmware. See PROTOCOL.md."""
