"""``bayesgrasp serve``: plans over HTTP."""

from __future__ import annotations

from pathlib import Path

import torch

from bayesgrasp.files import MIB, read_text
from bayesgrasp.serving.app import check_token
from bayesgrasp.serving.app import serve as serve_plans
from bayesgrasp.serving.service import PlanService, ServiceLimits
from bayesgrasp.workflows.load import load_planner

LARGEST_TOKEN = 4096
"""Bytes of the file of a token."""


def serve(
    host: str = "127.0.0.1",
    port: int = 8000,
    token_file: Path | None = None,
    model: Path | None = None,
    device: str = "cpu",
    workers: int = 1,
    longest: float = 30.0,
    largest: int = 16,
) -> None:
    """Plan grasps for whoever asks over HTTP.

    POST /plan takes a depth file in base64 and a camera file as one piece of JSON and answers with the plan, or refuses
    with its reason; GET /health and GET /metrics (Prometheus) say how it goes. Ends with Ctrl-C.

    Args:
        host: Address; any other than this machine's own needs a token.
        port: Its number.
        token_file: File with the token that clients must send as `Authorization: Bearer TOKEN`.
        model: Directory of a trained model; by default the one that comes with the package.
        device: Where to compute: cpu, cuda, or cuda:N.
        workers: Plans at a time, each in a thread.
        longest: Seconds after which a client is told that it takes too long.
        largest: MiB of a request.
    """
    limits = ServiceLimits(workers=workers, longest=longest, largest=largest * MIB)
    token = None if token_file is None else read_text(token_file, LARGEST_TOKEN).strip()
    check_token(host, token)
    torch.set_num_threads(1)  # one thread for each worker
    service = PlanService(load_planner(model, device=device), limits)
    print(f"serving plans on http://{host}:{port}/plan, {workers} at a time", flush=True)
    serve_plans(service, host, port, token)
