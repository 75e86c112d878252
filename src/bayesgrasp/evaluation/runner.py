"""Every strategy in every scene, judged by the lift test, on any number of processes, with the same result for any.

The search of scene i has one random stream, whatever the strategy: all strategies of a
scene meet the same object, frictions, image and draws from the prior, so their differences are differences of paired
attempts. The lift test uses the scene's own nuisances, which no strategy but the full-observation ones (friction) sees.

Under a shift (`shifts`) the scenes and their random numbers stay the same. Strategies whose view of the scene it does
not change need not search again: given the results without the shift, their hands are executed as they are.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.evaluation.baselines.force_closure import ForceClosure
from bayesgrasp.evaluation.baselines.top_down import top_down
from bayesgrasp.evaluation.journal import NO_PLAN, Journal, SceneResult, Trial
from bayesgrasp.evaluation.scenes import SceneMaker, ScenePriors, Situation
from bayesgrasp.evaluation.shifts import NONE, Shift
from bayesgrasp.evaluation.strategies import (
    FULL,
    STRATEGIES,
    Choose,
    SearchConfig,
    Strategy,
    from_the_image,
    missing,
    model_strategies,
    planned,
    replans,
    unpromised,
)
from bayesgrasp.generation.pool import processes
from bayesgrasp.generation.provenance import object_hash
from bayesgrasp.lift.lift_test import LiftTest
from bayesgrasp.objects.object_asset import ObjectAsset
from bayesgrasp.planning.planner import Planner
from bayesgrasp.ratio.model import GraspModel
from bayesgrasp.seeding import Stream, generator
from bayesgrasp.types import Attempts, Outcome


@dataclass(frozen=True)
class Contestants:
    """A trained model and the planner around it."""

    model: GraspModel
    planner: Planner


@dataclass(frozen=True)
class Benchmark:
    """What is run; picklable.

    Attributes:
        objects: The object set.
        load: Makes model and planner, once in each process.
        strategies: Names out of `STRATEGIES`.
        seed: Of all random numbers.
        search: Of the optimising strategies.
        priors: Of scenes and nuisances.
        shift: How the world departs from them.

    Raises:
        InvalidConfigurationError: No objects, no strategies, or an unknown one.
    """

    objects: tuple[ObjectAsset, ...]
    load: Callable[[], Contestants]
    strategies: tuple[str, ...] = STRATEGIES
    seed: int = 0
    search: SearchConfig = field(default_factory=SearchConfig)
    priors: ScenePriors = field(default_factory=ScenePriors)
    shift: Shift = NONE

    def __post_init__(self) -> None:
        unknown = [name for name in self.strategies if name not in STRATEGIES]
        if unknown or not self.strategies or not self.objects:
            raise InvalidConfigurationError(
                f"a benchmark needs objects, and strategies out of {', '.join(STRATEGIES)}; "
                f"got {len(self.objects)} objects and the strategies {', '.join(self.strategies) or 'none'}"
            )

    def start(self) -> Callable[[Task], SceneResult]:
        """The function from a scene to its result."""
        return _Worker(self).run

    def identity(self, card: Mapping[str, Any]) -> dict[str, Any]:
        """What makes two runs the same, given the card of the model."""
        judge = self.shift.lift_test_config
        weights = {role: entry.get("sha256") for role, entry in card.get("estimators", {}).items()}
        return {
            "seed": self.seed,
            "objects": {asset.id: object_hash(asset) for asset in self.objects},
            "strategies": list(self.strategies),
            "model": weights,
            "search": asdict(self.search),
            "priors": asdict(self.priors),
            "shift": asdict(self.shift),
            "lift_test": judge.settings() | {"hold": asdict(judge.hold)},
        }


@dataclass(frozen=True)
class Task:
    """A scene to be run.

    Attributes:
        number: i.
        known: Its result without the shift, if there is one.
    """

    number: int
    known: SceneResult | None = field(default=None, repr=False)


def skipped(benchmark: Benchmark, card: Mapping[str, Any]) -> dict[str, str]:
    """Strategies that cannot run, or not on all objects, and why, in words."""
    roles, meshes = tuple(card.get("estimators", ())), set(card.get("objects", ()))
    new = [asset.id for asset in benchmark.objects if asset.id not in meshes]
    reasons: dict[str, str] = {}
    for name in benchmark.strategies:
        if (lack := missing(name, roles)) is not None:
            reasons[name] = lack
        elif name in FULL and new:
            reasons[name] = f"the model never had {_some(new)}; full observation needs the mesh's identity"
    return reasons


def run(
    benchmark: Benchmark,
    attempts: int,
    workers: int = 1,
    journal: Journal | None = None,
    progress: Callable[[SceneResult], None] | None = None,
    known: Sequence[SceneResult] = (),
) -> tuple[SceneResult, ...]:
    """Run scenes 0 to ``attempts`` - 1, but for those that the journal has.

    Args:
        benchmark: What is run.
        attempts: Scenes, which is attempts of each strategy.
        workers: Processes; 1 stays in this one.
        journal: Keeps every finished scene.
        progress: Called with every finished scene, in any order; also with those of the journal.
        known: Results of the same benchmark without its shift; hands that the shift cannot change are taken from them.

    Returns:
        Results by the number of the scene.

    Raises:
        InvalidConfigurationError: No attempt or no worker.
    """
    if attempts < 1 or workers < 1:
        raise InvalidConfigurationError(f"attempts and workers must be at least 1, got {attempts} and {workers}")
    kept = {} if journal is None else journal.results
    results = {number: result for number, result in kept.items() if number < attempts}
    for result in results.values():
        _tell(progress, result)
    unshifted = {result.number: result for result in known}
    todo = [Task(number, unshifted.get(number)) for number in range(attempts) if number not in results]
    if todo:
        with processes(min(workers, len(todo))).start(benchmark.start) as work:
            for result in work(todo):
                results[result.number] = result
                if journal is not None:
                    journal.add(result)
                _tell(progress, result)
    return tuple(results[number] for number in sorted(results))


class _Worker:
    """Simulators, model and strategies of one process."""

    def __init__(self, benchmark: Benchmark) -> None:
        contestants = benchmark.load()
        self.benchmark, card = benchmark, contestants.model.card
        self.scenes = SceneMaker(benchmark.objects, benchmark.seed, benchmark.priors, benchmark.shift)
        self.lift_test = LiftTest(benchmark.objects, benchmark.shift.lift_test_config)
        self.meshes = set(card.get("objects", ()))
        able = [name for name in benchmark.strategies if missing(name, tuple(contestants.model.estimators)) is None]
        every = self._strategies(contestants)
        self.strategies = {name: every[name] for name in able}

    def _strategies(self, contestants: Contestants) -> dict[str, Strategy]:
        planner = contestants.planner
        baselines: dict[str, Choose] = {
            "top_down": from_the_image(top_down(planner.observer.reader, planner.robot)),
            "force_closure": ForceClosure(planner.prior, self.lift_test).choose,
        }
        silent = model_strategies(contestants.model, planner.prior, self.benchmark.search) | baselines
        return {name: unpromised(choose) for name, choose in silent.items()} | {"plan": planned(planner)}

    def run(self, task: Task) -> SceneResult:
        """The result of one scene."""
        situation = self.scenes.make(task.number)
        trials = {
            name: self._repeat(name, task.known, situation)
            if task.known is not None and name in task.known.trials and not replans(name, self.benchmark.shift)
            else self._trial(choose, situation)
            for name, choose in self.strategies.items()
            if name not in FULL or situation.asset.id in self.meshes
        }
        scene = {name: column[0].item() for name, column in situation.nuisances.columns().items()}
        scene |= {"object_index": int(situation.scene.object_index[0]), "scale": float(situation.scene.scale[0])}
        return SceneResult(task.number, situation.asset.id, object_pose=situation.pose, trials=trials, **scene)

    def _trial(self, strategy: Strategy, situation: Situation) -> Trial:
        rng = generator(self.benchmark.seed, Stream.BENCHMARK_SEARCH, situation.number)
        started = time.perf_counter()
        choice = strategy(situation, rng)
        seconds = time.perf_counter() - started
        if choice is None:
            return Trial(NO_PLAN, seconds)
        return replace(self._judged(situation.attempts(choice.hands), seconds), promised=choice.promised)

    def _repeat(self, name: str, known: SceneResult, situation: Situation) -> Trial:
        """The known hand of a strategy in the scene as it is now."""
        attempt = known.attempt(name)
        if attempt is None:
            return known.trials[name]
        here = situation.scene.columns() | situation.nuisances.columns()
        trial = known.trials[name]
        return replace(self._judged(replace(attempt, **here), trial.seconds), promised=trial.promised)

    def _judged(self, attempts: Attempts, seconds: float) -> Trial:
        verdicts = self.lift_test.judge(attempts)
        outcome = Outcome(int(verdicts.outcomes[0])).name.lower()
        position, quaternion = (tuple(map(float, row[0])) for row in (attempts.position, attempts.quaternion))
        held = bool(verdicts.held[0])
        return Trial(outcome, seconds, held, position, quaternion, int(attempts.grasp_type[0]))


def _tell(progress: Callable[[SceneResult], None] | None, result: SceneResult) -> None:
    if progress is not None:
        progress(result)


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:5]) + (f" and {len(names) - 5} others" if len(names) > 5 else "")
