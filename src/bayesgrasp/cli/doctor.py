"""``bayesgrasp doctor``: what this machine has, what is missing, and what to do about it, in words."""

import platform


def doctor() -> None:
    """Report versions, hardware, caches, and what is missing."""
    print(f"python {platform.python_version()}")
