"""Where things that are expensive to make are kept between runs: one directory per user, or the one that they name."""

import os
from pathlib import Path

import platformdirs

CACHE_VARIABLE = "BAYESGRASP_CACHE_DIR"


def cache_directory() -> Path:
    """The cache directory: ``$BAYESGRASP_CACHE_DIR``, or the platform's own place for caches. It need not exist yet."""
    named = os.environ.get(CACHE_VARIABLE)
    return Path(named).expanduser() if named else Path(platformdirs.user_cache_dir("bayesgrasp"))
