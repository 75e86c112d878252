"""``bayesgrasp calibrate``: what the plans of a model deliver on objects that it never met."""

from __future__ import annotations

import os
from pathlib import Path

from bayesgrasp.cli.object_set import Objects, ObjectSet
from bayesgrasp.cli.progress import benchmarking
from bayesgrasp.diagnostics.plots import save
from bayesgrasp.diagnostics.promises import keep_promises
from bayesgrasp.files import write_json
from bayesgrasp.ratio.delivery import DOUBT, Delivery
from bayesgrasp.workflows.delivery import DeliveryJob

CONFIDENCES = (0.8, 0.9, 0.95, 0.98, 0.99)


def calibrate(
    model: Path,
    out: Path,
    objects: Objects = ObjectSet("procedural:1000@77"),  # noqa: B008 - frozen
    seed: int = 0,
    workers: int = os.cpu_count() or 1,
    resume: bool = False,
) -> None:
    """Calibrate what a model promises by what its plans deliver on fresh objects.

    Plans one grasp for each object from its image, tries it in the lift test, and writes promises and outcomes into the
    model's card: `plan` then promises what held on fresh objects, and `plan --confidence` knows which promises are
    enough.

    Args:
        model: Directory of the model; its card is changed.
        out: Directory of the run: scenes.jsonl, promises.json and promises.png.
        objects: Objects that the model was not trained with, at least 100.
        seed: Same seed, same scenes and plans.
        workers: Processes.
        resume: Go on with the run in --out, or start it where there is none.
    """
    job = DeliveryJob(model, objects.load(), objects.split, seed)
    with benchmarking(len(job.objects), "calibration") as progress:
        results = job.run(out, workers, resume=resume, progress=progress)
    delivery = job.write(results)
    before = keep_promises(delivery.promised, delivery.success)
    after = keep_promises(delivery.calibration.of(delivery.promised), delivery.success)
    print(f"before: {before}\nafter:  {after} (on the same plans)")
    enough = {wanted: delivery.least_promise(wanted) for wanted in CONFIDENCES}
    for wanted, promise in enough.items():
        print(f"confidence {wanted:.2f}: {_in_words(promise, delivery)}")
    write_json(
        out / "promises.json",
        {
            "before": before.to_dict(),
            "after": after.to_dict(),
            "least_promise": {str(wanted): promise for wanted, promise in enough.items()},
            "doubt": DOUBT,
        },
    )
    save(before.draw(), out / "promises.png")
    print(f"wrote {model / 'card.json'} and {out}")


def _in_words(promise: float | None, delivery: Delivery) -> str:
    if promise is None:
        return "no promise is enough"
    kept = (delivery.calibration.of(delivery.promised) >= promise).mean()
    return f"a promise of {100 * promise:.1f} % is enough, which {100 * kept:.0f} % of the plans make"
