"""Every error that a user of Sweeper can meet, on one page.

Each message is one sentence: what is wrong, in which file, key or field, and the remedy.
The command line prints it and exits with code 2; a traceback is only ever our own mistake.
"""


class SweeperError(Exception):
    """Base of all errors that are explained to the user instead of traced."""


class ConfigError(SweeperError, ValueError):
    """A configuration file has an unknown key, a wrong type or a value out of range."""


class CalibrationError(SweeperError, ValueError):
    """A camera calibration is missing, incomplete or impossible."""


class ModelError(SweeperError, ValueError):
    """A network file is missing, damaged or does not fit the camera."""


class FrameError(SweeperError, ValueError):
    """A camera frame or a folder of recorded frames cannot be used."""


class LogError(SweeperError, ValueError):
    """A log is missing, truncated or was written by something else."""


class MapError(SweeperError, ValueError):
    """A saved map is missing, damaged or of another version."""


class SceneError(SweeperError, ValueError):
    """A simulator scene is missing, malformed or cannot be built."""


class DataError(SweeperError, ValueError):
    """A data set handed to a benchmark is missing or malformed."""


class HardwareError(SweeperError, OSError):
    """A device (serial port, camera, I2C sensor) is missing or does not answer."""


class RequestError(SweeperError, ValueError):
    """A request to a running robot has an unknown verb, or arguments that make no sense."""


class MissingExtraError(SweeperError, ImportError):
    """An optional dependency is not installed."""
