"""A model of your own in a minute: simulate, train, plan.

    python examples/train_small.py

One object and few attempts, so the model is a poor one; with the 24 training objects, millions of attempts and
`practise`, the same calls made the shipped one (`results/weights.md`).
"""

from pathlib import Path

import bayesgrasp as bg
from bayesgrasp.evaluation.demonstration import demonstrate
from bayesgrasp.generation.chunks import GenerateConfig
from bayesgrasp.generation.pool import Executor, LocalPool
from bayesgrasp.training.train_estimator import TrainConfig
from bayesgrasp.types import Outcome
from bayesgrasp.workflows.generate import GenerateJob, generate
from bayesgrasp.workflows.train import TrainOptions

TWO_PROCESSES = LocalPool(2)


def main(
    out: Path = Path("out/small"), attempts: int = 8192, epochs: int = 4, executor: Executor = TWO_PROCESSES
) -> Outcome | None:
    """Make a data set and a model below a directory, and let the model plan.

    Args:
        out: Where both go.
        attempts: Lift tests.
        epochs: Passes over their images.
        executor: Who simulates; the data do not depend on it.
    """
    objects = bg.load_objects(["household_drink_can"])
    # Four images for every 128 attempts; see `docs/data.md` for what is drawn and why.
    config = GenerateConfig(attempts_per_draw=128, scenes_per_draw=4)
    manifest = generate(GenerateJob(objects, attempts, config), out / "data", executor)
    print(f"{manifest.attempts} attempts in {out / 'data'}")
    options = TrainOptions(estimators=("success",), schedule=TrainConfig(epochs=epochs))
    metrics = bg.train(out / "data", out / "model", options)
    losses = metrics["success"]["validation_loss"]
    print(f"loss on held-out images after each epoch: {', '.join(f'{loss:.3f}' for loss in losses)}")
    shown = demonstrate(bg.load(out / "model"), objects[0], seed=0)
    print(f"its plan: {shown.outcome.name.lower() if shown.outcome is not None else shown.plan.reason}")
    return shown.outcome


if __name__ == "__main__":
    main()
