"""What can go wrong outside the line itself. Noise on the line is never an error."""


class BridgeError(RuntimeError):
    """The port, the compiler or the host firmware is missing or failed: one sentence, a remedy."""
