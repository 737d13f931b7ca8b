"""Sweeper: the runtime of a robot vacuum that sees with two cameras."""

__version__ = "0.1.0"
