"""The same work on a Ray cluster; the only file that knows Ray.

Chunks are plain tasks that Ray runs anywhere and runs again where a worker process or a whole node is lost; results
come back to the driver, which alone writes. Each worker process builds the simulators once, when it gets its first
chunk. A task's result does not depend on where it runs, so a task run twice changes nothing.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from typing import Any

import ray

from bayesgrasp.errors import BayesgraspError, DataError, InvalidConfigurationError
from bayesgrasp.generation.pool import MapTasks, Result, Task, Work, built


@dataclass(frozen=True)
class RayPool:
    """Tasks on a Ray cluster.

    Attributes:
        address: Of a running cluster ("auto" finds the one on this machine); None starts one here.
        under_way: Chunks given out at a time; 0 for one and a half per core of the cluster.

    Raises:
        InvalidConfigurationError: A negative number of chunks.
    """

    address: str | None = None
    under_way: int = 0

    def __post_init__(self) -> None:
        if self.under_way < 0:
            raise InvalidConfigurationError(f"the number of chunks under way must be >= 0, got {self.under_way}")

    @contextmanager
    def start(self, build: Callable[[], Work[Task, Result]]) -> Iterator[MapTasks[Task, Result]]:
        """See `Executor`; connects to the cluster, and leaves it at the end."""
        options: dict[str, Any] = {} if self.address else {"include_dashboard": False}
        try:
            ray.init(address=self.address, log_to_driver=False, **options)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise DataError(f"cannot reach a Ray cluster at {self.address or 'this machine'}: {error}") from error
        try:
            shared = ray.put(build)
            key = uuid.uuid4().hex
            yield lambda tasks: self._map(key, shared, tasks)
        finally:
            ray.shutdown()

    def _map(self, key: str, build: ray.ObjectRef[Any], tasks: Iterable[Task]) -> Iterator[Any]:
        waiting = iter(tasks)
        limit = self.under_way or max(2, int(1.5 * ray.cluster_resources().get("CPU", 1)))
        pending: list[ray.ObjectRef[Any]] = []
        while True:
            pending += [_run.remote(key, build, task) for task in islice(waiting, limit - len(pending))]
            if not pending:
                return
            ready, pending = ray.wait(pending, num_returns=1)
            yield self._result(ready[0])

    @staticmethod
    def _result(reference: ray.ObjectRef[Any]) -> Any:
        try:
            return ray.get(reference)
        except ray.exceptions.RayTaskError as error:
            if isinstance(error.cause, BayesgraspError):
                raise error.cause from error
            raise DataError(f"a task failed on the cluster: {error}") from error
        except ray.exceptions.RayError as error:
            raise DataError(f"the cluster lost a task for good: {error}") from error


@ray.remote(max_retries=-1, num_cpus=1)
def _run(key: str, build: Callable[[], Work[Any, Any]], task: Any) -> Any:
    """What a worker process does; Ray runs it again where the process or its node dies."""
    return built(key, build)(task)
