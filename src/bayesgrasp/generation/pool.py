"""A pool of worker processes that survives the death of a worker, and ends with its owner.

Each worker talks to the owner through a pipe of its own and holds no other end of any pipe. So a worker that is killed
(the kernel's memory killer is the usual one) is noticed by its sentinel, replaced, and its task given out again; and a
worker whose owner is killed leaves at once, in the middle of its task. `concurrent.futures` gives up in the first case
and leaves orphans in the second.

Results come back as they are ready. Nothing may depend on their order. Torch has one thread wherever work is done, as
sums of another number of threads differ in their last bits.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

import torch

from bayesgrasp.errors import BayesgraspError, DataError, InvalidConfigurationError

Task = TypeVar("Task")
Result = TypeVar("Result")
Work = Callable[[Task], Result]
MapTasks = Callable[[Iterable[Task]], Iterator[Result]]
"""Tasks in, results out as they are ready."""


@runtime_checkable
class Executor(Protocol):
    """Where work is done."""

    def start(self, build: Callable[[], Work[Task, Result]]) -> AbstractContextManager[MapTasks[Task, Result]]:
        """Start workers; each calls ``build`` once and then the function it returns for every task it gets."""
        ...


class InProcess:
    """Does the work in the calling process, one task after another."""

    @contextmanager
    def start(self, build: Callable[[], Work[Task, Result]]) -> Iterator[MapTasks[Task, Result]]:
        """See `Executor`."""
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            work = build()
            yield lambda tasks: map(work, tasks)
        finally:
            torch.set_num_threads(threads)


@dataclass(frozen=True)
class LocalPool:
    """Worker processes on this machine.

    Attributes:
        workers: How many.
        attempts: How often one task may lose its worker before the run gives up.

    Raises:
        InvalidConfigurationError: No workers.
    """

    workers: int
    attempts: int = 3

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise InvalidConfigurationError(f"workers must be at least 1, got {self.workers}")

    @contextmanager
    def start(self, build: Callable[[], Work[Task, Result]]) -> Iterator[MapTasks[Task, Result]]:
        """See `Executor`. ``build`` and what it closes over must be picklable."""
        crew = [_Worker(build) for _ in range(self.workers)]
        try:
            yield lambda tasks: _TaskPass(crew, self.attempts, iter(tasks)).results()
        finally:
            for worker in crew:
                worker.stop()


def processes(workers: int) -> InProcess | LocalPool:
    """So many processes of this machine; the calling one alone for 1."""
    return InProcess() if workers == 1 else LocalPool(workers)


class _Worker(Generic[Task, Result]):
    """One process and the task it is at."""

    def __init__(self, build: Callable[[], Work[Task, Result]]) -> None:
        self.build = build
        self.task: Task | None = None
        self.process: SpawnProcess
        self.pipe: Connection
        self.launch()

    def launch(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, self.build), daemon=True)
        # Born with Ctrl-C held back: it is the owner's to handle, also while a worker is still importing.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self.process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()

    def give(self, task: Task) -> None:
        self.task = task
        try:
            self.pipe.send(task)
        except (BrokenPipeError, ConnectionResetError):
            return  # dead already: its sentinel says so

    def stop(self) -> None:
        self.pipe.close()
        self.process.terminate()
        self.process.join()
        self.process.close()


@dataclass
class _TaskPass(Generic[Task, Result]):
    """One pass over the tasks.

    Attributes:
        crew: The workers.
        attempts: See `LocalPool`.
        tasks: Tasks not given out yet.
        again: Tasks whose worker died.
        losses: How often each task lost its worker.
    """

    crew: list[_Worker[Task, Result]]
    attempts: int
    tasks: Iterator[Task]
    again: deque[Task] = field(default_factory=deque)
    losses: dict[int, int] = field(default_factory=dict)

    def results(self) -> Iterator[Result]:
        try:
            self._give_out()
            while any(worker.task is not None for worker in self.crew):
                yield from self._collect()
                self._give_out()
        finally:
            for worker in self.crew:  # left in the middle: what is under way is not wanted any more
                if worker.task is not None:
                    worker.task = None
                    worker.stop()
                    worker.launch()

    def _give_out(self) -> None:
        for worker in self.crew:
            if worker.task is None:
                task = self.again.popleft() if self.again else next(self.tasks, None)
                if task is not None:
                    worker.give(task)

    def _collect(self) -> Iterator[Result]:
        busy = [w for w in self.crew if w.task is not None]
        ready = wait([w.pipe for w in busy] + [w.process.sentinel for w in busy])
        for worker in busy:
            if worker.pipe in ready or worker.process.sentinel in ready:
                yield from self._receive(worker)

    def _receive(self, worker: _Worker[Task, Result]) -> Iterator[Result]:
        try:
            message = worker.pipe.recv_bytes()
        except (EOFError, OSError):  # OSError: it died while it handed over its result
            self._replace(worker)
            return
        worker.task = None
        answer = pickle.loads(message)
        if isinstance(answer, BayesgraspError):
            raise answer
        yield answer

    def _replace(self, worker: _Worker[Task, Result]) -> None:
        """Put a new process in the place of a dead one and its task back to the front."""
        task, worker.task = worker.task, None
        worker.process.join()
        code = worker.process.exitcode
        worker.stop()
        if code is not None and code >= 0:
            worker.launch()
            raise DataError(f"a worker failed (exit code {code}) on {task}; its own message is above")
        worker.launch()
        key = id(task)
        self.losses[key] = self.losses.get(key, 0) + 1
        if task is None or self.losses[key] >= self.attempts:
            raise DataError(f"{task} lost its worker {self.attempts} times (signal {-(code or 0)}); out of memory?")
        self.again.append(task)


def _serve(pipe: Connection, build: Callable[[], Work[Any, Any]]) -> None:
    """What a worker process does: build once, then answer tasks until the owner is gone."""
    threading.Thread(target=_leave_with_owner, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            answer = built("", build)(task)
        except BayesgraspError as error:
            answer = error
        try:
            pipe.send(answer)
        except (BrokenPipeError, ConnectionResetError):
            return


def built(run: str, build: Callable[[], Work[Task, Result]]) -> Work[Task, Result]:
    """In a worker process: the work of a run, built when it is first asked for and kept for all its tasks."""
    if run not in _BUILT:
        torch.set_num_threads(1)
        _BUILT.clear()
        _BUILT[run] = build()
    return _BUILT[run]


_BUILT: dict[str, Work[Any, Any]] = {}
"""The one place for process-wide state."""


def _leave_with_owner() -> None:
    """End this process as soon as the one that started it has ended; nobody wants the task that is under way."""
    owner = multiprocessing.parent_process()
    if owner is not None:
        wait([owner.sentinel])
        os._exit(1)
