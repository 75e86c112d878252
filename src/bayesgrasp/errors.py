"""The one root of every error that bayesgrasp raises on purpose.

A message says what is wrong, where, and what would be valid. The command line shows it without a traceback. What a
message quotes of a file or of another library is shortened: a damaged file must not fill the screen, nor send it
control characters.
"""

import reprlib


class BayesgraspError(Exception):
    """Root of all errors raised by bayesgrasp."""


class InvalidConfigurationError(BayesgraspError, ValueError):
    """A parameter is outside its valid range, or two parameters contradict each other."""


class FileError(BayesgraspError, OSError):
    """A file cannot be read or written: missing, too large, of another kind, or the disk is full or read-only."""


class AssetError(BayesgraspError):
    """An object, mesh, gripper or arm is missing or cannot be used."""


class DepthImageError(BayesgraspError, ValueError):
    """A depth image or a camera file has the wrong shape, type, unit or content."""


class DataError(BayesgraspError):
    """A data set is missing, damaged, or was made with another schema or configuration."""


class CheckpointError(BayesgraspError):
    """A model is missing, damaged, or was trained for another gripper, camera or schema."""


def shown(value: object, most: int = 60) -> str:
    """A value as a message quotes it: in ASCII, on one line, at most ``most`` characters."""
    quoting = reprlib.Repr()
    quoting.maxstring = quoting.maxother = quoting.maxlong = most
    quoting.maxlevel = 3
    try:
        text = quoting.repr(value).encode("ascii", "backslashreplace").decode()
    except ValueError:  # a whole number of thousands of digits has no decimal form
        text = f"a {type(value).__name__} too long to show"
    return clipped(text, most)


def clipped(text: object, most: int = 160) -> str:
    """What another library said, for the end of a message: on one line, printable, at most ``most`` characters."""
    line = "".join(c if c.isprintable() else "?" for c in " ".join(str(text).split()))
    return line if len(line) <= most else f"{line[: most - 3]}..."
