"""The one root of every error that bayesgrasp raises on purpose.

A message says what is wrong, where, and what would be valid. The command line shows it without a traceback.
"""


class BayesgraspError(Exception):
    """Root of all errors raised by bayesgrasp."""


class InvalidConfigurationError(BayesgraspError, ValueError):
    """A parameter is outside its valid range, or two parameters contradict each other."""


class AssetError(BayesgraspError):
    """An object, mesh, gripper or arm is missing or cannot be used."""


class DepthImageError(BayesgraspError, ValueError):
    """A depth image or a camera file has the wrong shape, type, unit or content."""


class DataError(BayesgraspError):
    """A data set is missing, damaged, or was made with another schema or configuration."""


class CheckpointError(BayesgraspError):
    """A model is missing, damaged, or was trained for another gripper, camera or schema."""
