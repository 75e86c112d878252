"""A connection to PyBullet, an optional extra of the package, inside this process."""

from __future__ import annotations

import importlib
import os
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

from bayesgrasp.errors import InvalidConfigurationError


class Client:
    """A connection to PyBullet: its functions, each called with the connection's number."""

    def __init__(self, module: ModuleType, number: int) -> None:
        self.module, self.number = module, number

    def __getattr__(self, name: str) -> Any:
        function, number = getattr(self.module, name), self.number
        if not callable(function):
            return function
        self.__dict__[name] = bound = lambda *args, **kwargs: function(*args, physicsClientId=number, **kwargs)
        return bound


def require() -> ModuleType:
    """PyBullet, which is an optional extra.

    Raises:
        InvalidConfigurationError: It is not installed.
    """
    try:
        with _silent():
            return importlib.import_module("pybullet")
    except ImportError as error:
        raise InvalidConfigurationError(
            "the engine 'pybullet' needs PyBullet: pip install 'bayesgrasp[pybullet]' (or use the engine 'mujoco')"
        ) from error


def connect() -> Client:
    """A connection to a simulation of its own inside this process; it ends with the client."""
    module = require()
    client = Client(module, module.connect(module.DIRECT))
    weakref.finalize(client, module.disconnect, client.number)
    return client


@contextmanager
def _silent() -> Iterator[None]:
    """PyBullet writes the time of its build to the standard error stream, from C, when it is imported."""
    kept, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)
