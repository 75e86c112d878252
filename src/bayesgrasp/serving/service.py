"""A planner that many ask at once: so many plans at a time, so many that wait, so long for each, and counted.

A plan is computed in one of a few threads and cannot be stopped there; a client that has waited too long is told so,
and the plan's thread is free again when the plan is done. Everything that a plan draws comes from the request's own
seed, so an answer does not depend on who else asks.
"""

from __future__ import annotations

import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

from bayesgrasp.errors import BayesgraspError, InvalidConfigurationError
from bayesgrasp.files import MIB
from bayesgrasp.planning.planner import Planner
from bayesgrasp.serving.request import read_request

OK, WRONG, NO_GRASP, BUSY = 200, 400, 422, 503
"""Statuses of HTTP: a plan with grasps, wrong input, a plan without a grasp, too many ask."""


@dataclass(frozen=True)
class ServiceLimits:
    """What a service takes on.

    Attributes:
        workers: Plans at a time, each in a thread of its own.
        most_waiting: Requests that may wait for one of these, beside those that are planned.
        longest: Seconds after which a client is told that it takes too long.
        largest: Bytes of a request.
    """

    workers: int = 1
    most_waiting: int = 64
    longest: float = 30.0
    largest: int = 16 * MIB

    def __post_init__(self) -> None:
        if self.workers < 1 or self.most_waiting < 0 or not self.longest > 0 or self.largest < 1:
            raise InvalidConfigurationError(
                "workers and largest must be at least 1, most_waiting at least 0, and longest positive, got "
                f"{self.workers}, {self.largest}, {self.most_waiting} and {self.longest}"
            )


@dataclass(frozen=True)
class Answer:
    """What a client is told.

    Attributes:
        status: Of HTTP.
        content: The plan as plain data, or `error` with one line.
        seconds: That the plan took, without waiting; 0 where nothing was planned.
    """

    status: int
    content: dict[str, Any]
    seconds: float = 0.0


@dataclass
class PlanService:
    """Plans for requests.

    Attributes:
        planner: Who plans.
        limits: What is taken on.
    """

    planner: Planner
    limits: ServiceLimits = field(default_factory=ServiceLimits)

    def __post_init__(self) -> None:
        self._threads = ThreadPoolExecutor(self.limits.workers, thread_name_prefix="plan")
        self._places = threading.BoundedSemaphore(self.limits.workers + self.limits.most_waiting)

    def submit(self, body: bytes) -> Future[Answer] | None:
        """Start on a request as soon as a thread is free; None where too many wait already."""
        if not self._places.acquire(blocking=False):
            return None
        future = self._threads.submit(self.answer, body)
        future.add_done_callback(lambda _: self._places.release())
        return future

    def answer(self, body: bytes) -> Answer:
        """Plan for one request, here and now."""
        start = time.perf_counter()
        try:
            asked = read_request(body)
            plan = self.planner.plan(
                asked.depth, asked.camera, top=asked.top, constraints=asked.constraints, seed=asked.seed
            )
        except BayesgraspError as error:
            return Answer(WRONG, {"error": str(error)})
        return Answer(OK if plan.grasps else NO_GRASP, plan.to_dict(), time.perf_counter() - start)

    def close(self) -> None:
        """Take no more, forget those that wait, and let those that are planned end."""
        self._threads.shutdown(cancel_futures=True)
