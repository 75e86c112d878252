"""The service as a web application: `POST /plan`, `GET /health`, `GET /metrics`.

| status of `/plan` | |
|---|---|
| 200 | the plan, as `bayesgrasp plan --json` writes it |
| 400 | wrong input, in one line (`error`) |
| 401 | no token, or a wrong one |
| 413 | the request is larger than allowed |
| 422 | the plan has no grasp; `reason` says why |
| 503, 504 | too many ask; it takes too long |

Who may reach another address than this machine's own may be anybody, so a token is asked for there.
"""

from __future__ import annotations

import asyncio
import hmac
import ipaddress
import socket
import threading
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager

from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.serving.service import BUSY, NO_GRASP, OK, WRONG, Answer, PlanService

try:
    import uvicorn
    from fastapi import FastAPI, Request, Response
    from fastapi.responses import JSONResponse
    from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest
except ImportError as missing:
    raise InvalidConfigurationError("serving needs an extra: pip install 'bayesgrasp[serve]'") from missing

UNKNOWN_CLIENT, TOO_LARGE, TOO_LATE = 401, 413, 504
OUTCOMES = {
    OK: "grasp",
    NO_GRASP: "no_grasp",
    WRONG: "wrong_input",
    TOO_LARGE: "too_large",
    BUSY: "busy",
    TOO_LATE: "too_late",
}
"""Statuses as metrics count them."""
SHORTEST_TOKEN = 16


class Metrics:
    """Numbers of one service, in the text format of Prometheus."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.plans = Counter("bayesgrasp_plans", "Requests by outcome.", ["outcome"], registry=self.registry)
        self.seconds = Histogram(
            "bayesgrasp_plan_seconds",
            "Time of a plan without waiting.",
            buckets=(0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0),
            registry=self.registry,
        )
        self.under_way = Gauge("bayesgrasp_under_way", "Requests that wait or are planned.", registry=self.registry)

    def count(self, answer: Answer) -> None:
        """Count an answer."""
        self.plans.labels(OUTCOMES[answer.status]).inc()
        if answer.seconds:
            self.seconds.observe(answer.seconds)


def application(service: PlanService, token: str | None = None) -> FastAPI:
    """The application of a service.

    Args:
        service: Who plans.
        token: That a client must send (`Authorization: Bearer TOKEN`), but for `/health`; None for no token.
    """
    app, metrics = FastAPI(title="bayesgrasp", openapi_url=None), Metrics()

    @app.middleware("http")
    async def guard(request: Request, go_on: Callable[[Request], Awaitable[Response]]) -> Response:
        if token is None or request.url.path == "/health" or _is_known(request, token):
            return await go_on(request)
        return JSONResponse({"error": "a token is needed: Authorization: Bearer TOKEN"}, UNKNOWN_CLIENT)

    @app.get("/health")
    async def health() -> dict[str, str]:
        return {"status": "ok"}

    @app.get("/metrics")
    async def numbers() -> Response:
        return Response(generate_latest(metrics.registry), media_type="text/plain; version=0.0.4")

    @app.post("/plan")
    async def plan(request: Request) -> Response:
        with metrics.under_way.track_inprogress():
            answer = await _answer(service, request)
        metrics.count(answer)
        return JSONResponse(answer.content, answer.status)

    return app


def serve(service: PlanService, host: str, port: int, token: str | None) -> None:
    """Answer requests until the process is told to end.

    Raises:
        InvalidConfigurationError: As for `check_token`.
    """
    check_token(host, token)
    try:
        configured(service, host, port, token).run()
    finally:
        service.close()


def configured(service: PlanService, host: str, port: int, token: str | None) -> uvicorn.Server:
    """The server of a service, not started."""
    app = application(service, token)
    return uvicorn.Server(uvicorn.Config(app, host, port, log_level="warning", ws="none", lifespan="off"))


@contextmanager
def in_background(service: PlanService, token: str | None = None) -> Iterator[str]:
    """A service on a free port of this machine, in a thread; gives its address, and ends with the block."""
    with socket.create_server(("127.0.0.1", 0)) as place:
        server = configured(service, "127.0.0.1", 0, token)
        thread = threading.Thread(target=server.run, args=([place],))
        thread.start()
        try:
            yield f"http://127.0.0.1:{place.getsockname()[1]}"
        finally:
            server.should_exit = True
            thread.join()
            service.close()


def check_token(host: str, token: str | None) -> None:
    """Refuse an address that others can reach without a token.

    Raises:
        InvalidConfigurationError: Nobody but this machine may ask without a token, or the token is short.
    """
    if token is not None and (len(token) < SHORTEST_TOKEN or not token.isascii()):
        raise InvalidConfigurationError(f"a token has at least {SHORTEST_TOKEN} characters, all of ASCII")
    if token is None and not _is_own(host):
        raise InvalidConfigurationError(
            f"{host} may be reached by others: put a token of at least {SHORTEST_TOKEN} characters into a file and "
            "give --token-file, or serve on 127.0.0.1"
        )


def _is_own(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _is_known(request: Request, token: str) -> bool:
    sent = request.headers.get("authorization", "")
    return hmac.compare_digest(sent.encode(), f"Bearer {token}".encode())


async def _answer(service: PlanService, request: Request) -> Answer:
    body = bytearray()
    try:
        async with asyncio.timeout(service.limits.longest):
            async for part in request.stream():
                body += part
                if len(body) > service.limits.largest:
                    return _refusal(TOO_LARGE, f"a request has at most {service.limits.largest} bytes")
            future = service.submit(bytes(body))
            if future is None:
                return _refusal(BUSY, "too many ask at once: try again later")
            return await asyncio.wrap_future(future)
    except TimeoutError:
        return _refusal(TOO_LATE, f"there was no answer within {service.limits.longest:g} s")


def _refusal(status: int, words: str) -> Answer:
    return Answer(status, {"error": words})
