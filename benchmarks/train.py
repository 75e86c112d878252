"""Speed of training and of inference, and the paper's network in sbi's trainer side by side; process CPU time.

* Images per second and core in training, of the paper's network and of the best, at 256 x 160 (must: 200).
* Time from an image to its context at batch 1, and value and gradient at 1, 10, 1000, 3000 hands.
* The paper's d_theta trained by this package and by `sbi` on the same simulations, for the same epochs and with the
  same batch size: time, and the same held-out loss of both. Needs the extra `bayesgrasp[bench]`; skipped without it.
* The same with and without bfloat16, for several seeds: it does not hurt if the losses differ no more than seeds do.

    OMP_NUM_THREADS=1 MALLOC_TRIM_THRESHOLD_=2000000000 MALLOC_MMAP_THRESHOLD_=2000000000 \
        python benchmarks/train.py [--pairs 4096] [--epochs 5] [--seeds 3] [--json FILE]

The two variables keep glibc from returning memory to the system after every step.
"""

import importlib.util
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from json import dumps
from pathlib import Path
from statistics import median
from typing import Any

import torch
import torch.nn.functional as F  # noqa: N812
import tyro
from torch import Tensor, nn

from bayesgrasp.data.schema import Batch
from bayesgrasp.files import write_json
from bayesgrasp.known.analytic import AnalyticConfig, AnalyticGrasping
from bayesgrasp.known.bar_image import BarImage
from bayesgrasp.prior.grasp import GraspPrior
from bayesgrasp.ratio.estimators import ImageConfig
from bayesgrasp.ratio.kinds import build
from bayesgrasp.ratio.layers import ConvEncoder, HandFeatures
from bayesgrasp.ratio.model import GraspModel, Role
from bayesgrasp.seeding import generator, torch_generator
from bayesgrasp.training.objectives import ImageObjective, Objective
from bayesgrasp.training.presets import PresetName, Setup, preset
from bayesgrasp.training.sources import Sources
from bayesgrasp.training.train_estimator import TrainConfig, initialised, train_estimator
from bayesgrasp.types import Hands

SCENES, HANDS, REPEATS = 32, 32, 5
COUNTS = (1, 10, 1000, 3000)
PRIOR = GraspPrior()
ESTIMATORS: tuple[tuple[PresetName, Role], ...] = (("paper", "image"), ("paper", "success"), ("best", "success"))


def seconds(work: Callable[[], object], repeats: int = REPEATS) -> float:
    """Median CPU time of one call, after a first one that does not count."""
    work()
    times = []
    for _ in range(repeats):
        started = time.process_time()
        work()
        times.append(time.process_time() - started)
    return median(times)


def synthetic(scenes: int, hands: int) -> Batch:
    """A batch of noise: speed does not depend on what is learned."""
    rng = torch_generator(0)
    drawn = PRIOR.sample(scenes * hands, generator(0))
    fields = (drawn.position, drawn.rotation, drawn.grasp_type)
    success = (torch.rand(scenes, hands, generator=rng) < 0.2).float()
    ones = torch.ones(scenes, hands)
    images = 0.6 + 0.3 * torch.rand(scenes, 1, 160, 256, generator=rng)
    rows = Hands(*(x.unflatten(0, (scenes, hands)) for x in fields))
    index = torch.zeros(scenes, dtype=torch.int64)
    return Batch(rows, success, ones, ones, images, index, ones[:, 0], torch.zeros(scenes, 3), ones, success)


def training_rate(estimator: nn.Module, objective: Objective, bf16: bool) -> float:
    """Images per second of forward, backward and update."""
    batch, optimizer = synthetic(SCENES, HANDS), torch.optim.AdamW(estimator.parameters())

    def step() -> None:
        with torch.autocast("cpu", torch.bfloat16, enabled=bf16):
            loss = objective.loss(estimator, batch, torch_generator(0))
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()

    estimator.train()
    return SCENES / seconds(step)


def inference(role: str, estimator: nn.Module) -> dict[str, float]:
    """Milliseconds of the encoding and of the head."""
    estimator.eval().requires_grad_(False)
    image = synthetic(1, 1).images[0]
    model = GraspModel({"success": estimator}, {})
    ratio = model.given_image(image)
    result = {"encode_ms": 1e3 * seconds(lambda: model.given_image(image), 20)}
    for count in COUNTS:
        hands = PRIOR.sample(count, generator(1))

        def value_and_gradient(hands: Hands = hands) -> None:
            leaf = Hands(hands.position.requires_grad_(), hands.rotation.requires_grad_(), hands.grasp_type)
            torch.autograd.grad(ratio(leaf).sum(), (leaf.position, leaf.rotation))

        def value(hands: Hands = hands) -> None:
            with torch.no_grad():
                ratio(hands)

        result[f"value_{count}_ms"] = 1e3 * seconds(value, 10)
        result[f"value_and_gradient_{count}_ms"] = 1e3 * seconds(value_and_gradient, 10)
    return result


@dataclass(frozen=True)
class Pairs:
    """A fixed set of pairs (i, h) from p(i, h | S=1), in shuffled batches."""

    images: Tensor
    hands: Hands
    batch_size: int

    def __len__(self) -> int:
        return len(self.images) // self.batch_size

    def batches(self, epoch: int) -> Iterator[Batch]:
        """The batches of an epoch."""
        order = torch.randperm(len(self.images), generator=torch_generator(5, epoch))
        return (self.batch(order[i * self.batch_size : (i + 1) * self.batch_size]) for i in range(len(self)))

    def batch(self, rows: Tensor) -> Batch:
        """One hand for each image."""
        ones = torch.ones(len(rows), 1)
        index = torch.zeros(len(rows), dtype=torch.int64)
        hands = self.hands[rows][:, None]
        return Batch(
            hands, ones, ones, ones, self.images[rows], index, ones[:, 0], torch.zeros(len(rows), 3), ones, ones
        )


def simulated(count: int, seed: int, batch_size: int) -> Pairs:
    """Pairs of the analytic problem with images of 160 x 256."""
    picture = BarImage(size=(160, 256), pixel=0.0015625, noise=0.1)
    draws = AnalyticGrasping(PRIOR, AnalyticConfig(image=picture)).sample_successes(count, generator(seed))
    return Pairs(draws.image, draws.hands, batch_size)


def held_out_loss(score: Callable[[Tensor, Hands], Tensor], pairs: Pairs, shifts: int = 20) -> float:
    """NRE-A's loss over pairs, each image against the hands of 20 others; the same for every trainer."""
    size = len(pairs.images)
    with torch.no_grad():
        joint = F.softplus(-score(pairs.images, pairs.hands)).mean()
        rolled = [torch.arange(size).roll(s) for s in range(1, shifts + 1)]
        marginal = [F.softplus(score(pairs.images, pairs.hands[order])).mean() for order in rolled]
    return float(joint + torch.stack(marginal).mean())


def by_us(training: Pairs, held_out: Pairs, epochs: int, seed: int = 0, bf16: bool = True) -> dict[str, float]:
    """The paper's d_theta (the preset's architecture) in this package's loop, NRE-A."""
    (part,) = preset("paper", Setup(), ("image",))
    schedule = TrainConfig(epochs=epochs, seed=seed, bf16=bf16)
    started = time.process_time()
    objective = ImageObjective(hands=1, shifts=1)
    result = train_estimator(partial(build, part.kind, part.config), objective, Sources(training, held_out), schedule)
    spent = time.process_time() - started
    estimator: Any = result.estimator

    def score(images: Tensor, hands: Hands) -> Tensor:
        parts = torch.arange(len(images)).split(64)
        return torch.cat([estimator(estimator.encode(images[i]), hands[i][:, None])[:, 0] for i in parts])

    return {"cpu_s": spent, "held_out_loss": held_out_loss(score, held_out)}


def by_sbi(training: Pairs, held_out: Pairs, epochs: int) -> dict[str, float]:
    """The same encoder, head widths, batch size and epochs in sbi's NRE-A trainer, with its own defaults otherwise."""
    from sbi.inference import NRE_A
    from sbi.neural_nets import classifier_nn
    from torch.utils.tensorboard import SummaryWriter

    (part,) = preset("paper", Setup(), ("image",))
    if not isinstance(part.config, ImageConfig):
        raise TypeError(f"the paper's d_theta has another architecture: {part.config}")
    features = HandFeatures(part.config.hand).requires_grad_(False)
    encoder = initialised(partial(ConvEncoder, part.config.encoder), 0)

    def vector(hands: Hands) -> Tensor:
        return torch.cat([features(hands)[..., :12], hands.grasp_type[..., None].float() - 1], -1)

    network = classifier_nn("mlp", z_score_x="none", hidden_features=256, embedding_net_x=encoder)
    logs = tempfile.TemporaryDirectory()  # or sbi writes into the working directory
    writer = SummaryWriter(logs.name)
    inference = NRE_A(classifier=network, summary_writer=writer, show_progress_bars=False)
    started = time.process_time()
    # A tenth is held out by sbi itself, so it gets a tenth more: both learn from the same number of pairs.
    theta, x = (torch.cat([a, b[: len(a) // 9]]) for a, b in _both(vector, training, held_out))
    inference.append_simulations(theta, x)
    estimator = inference.train(
        training_batch_size=training.batch_size, max_num_epochs=epochs, stop_after_epochs=epochs, learning_rate=1e-3
    )
    spent = time.process_time() - started
    writer.close()
    logs.cleanup()
    estimator.eval()

    def score(images: Tensor, hands: Hands) -> Tensor:
        parts = torch.arange(len(images)).split(64)
        return torch.cat([estimator(vector(hands[i]), images[i]).flatten() for i in parts])

    return {"cpu_s": spent, "held_out_loss": held_out_loss(score, held_out)}


def _both(vector: Callable[[Hands], Tensor], a: Pairs, b: Pairs) -> tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]]:
    return (vector(a.hands), vector(b.hands)), (a.images, b.images)


def precision(training: Pairs, held_out: Pairs, epochs: int, seeds: int) -> dict[str, dict[str, list[float]]]:
    """Held-out losses with and without bfloat16, on the same data with the same seeds."""
    losses: dict[str, list[float]] = {}
    times: dict[str, list[float]] = {}
    for name, bf16 in (("bf16", True), ("fp32", False)):
        runs = [by_us(training, held_out, epochs, seed, bf16) for seed in range(seeds)]
        losses[name], times[name] = ([run[key] for run in runs] for key in ("held_out_loss", "cpu_s"))
    return {"held_out_loss": losses, "cpu_s": times}


def main(
    pairs: int = 4096,
    epochs: int = 5,
    batch_size: int = 64,
    seeds: int = 3,
    json: Path | None = None,
    speed: bool = True,
) -> None:
    """Measure and print.

    Args:
        pairs: Training pairs of the comparisons; a quarter of them are held out beside.
        epochs: Of all trainers.
        batch_size: Of all trainers.
        seeds: Runs with and without bfloat16; 0 leaves this comparison out.
        json: Where the numbers go, too.
        speed: Measure images per second and times of inference, too.
    """
    result: dict[str, Any] = {"threads": torch.get_num_threads(), "pairs": pairs, "epochs": epochs}
    if speed:
        result |= {f"{name} {role}": rates(name, role) for name, role in ESTIMATORS}
    training, held_out = simulated(pairs, 1, batch_size), simulated(max(batch_size, pairs // 4), 2, batch_size)
    result["side by side"] = {"bayesgrasp": by_us(training, held_out, epochs)}
    if importlib.util.find_spec("sbi") is not None:
        result["side by side"]["sbi"] = by_sbi(training, held_out, epochs)
    if seeds:
        result["precision"] = precision(training, held_out, epochs, seeds)
    print(dumps(result, indent=1))
    if json is not None:
        write_json(json, result)


def rates(name: PresetName, role: Role) -> dict[str, float]:
    """Speed of training of one estimator, and of inference where it is for planning."""
    (part,) = preset(name, Setup(), (role,))
    estimator = initialised(partial(build, part.kind, part.config), 0)
    numbers = {
        f"images_per_s_{'bf16' if bf16 else 'fp32'}": training_rate(estimator, part.objective, bf16)
        for bf16 in (True, False)
    }
    return numbers | (inference(role, estimator) if role == "success" else {})


if __name__ == "__main__":
    tyro.cli(main)
