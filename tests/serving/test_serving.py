"""The service over real sockets: the answers of `plan`, refusals in one line, limits, tokens, many clients."""

import base64
import io
import json
import threading
import urllib.error
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
import pytest
from box_scene import Box, box_depth_image
from untrained_model import save_untrained

from bayesgrasp.cli.main import main
from bayesgrasp.errors import InvalidConfigurationError
from bayesgrasp.geometry.camera import canonical_camera
from bayesgrasp.planning.planner import Planner
from bayesgrasp.serving.app import check_token, in_background
from bayesgrasp.serving.service import PlanService, ServiceLimits
from bayesgrasp.workflows.load import load_planner

TOKEN = "0123456789abcdef"
Sent = tuple[int, Any]


@pytest.fixture(scope="module")
def planner(tmp_path_factory: pytest.TempPathFactory) -> Planner:
    return load_planner(save_untrained(tmp_path_factory.mktemp("serving") / "model"))


def served(
    planner: Planner, limits: ServiceLimits | None = None, token: str | None = None
) -> AbstractContextManager[str]:
    """A service on a free port; gives its address."""
    return in_background(PlanService(planner, limits or ServiceLimits()), token)


def send(address: str, body: bytes | None = None, token: str | None = None) -> Sent:
    """Status and content of an answer."""
    headers = {} if token is None else {"Authorization": f"Bearer {token}"}
    try:
        with urllib.request.urlopen(urllib.request.Request(address, body, headers), timeout=60) as answer:
            text = answer.read().decode()
            return answer.status, json.loads(text) if text.startswith("{") else text
    except urllib.error.HTTPError as error:
        with error:
            return error.code, json.loads(error.read())


def asked(boxes: tuple[Box, ...] = (Box(x=0.02),), **more: Any) -> bytes:
    """A request for a plan for boxes on the table."""
    camera, file = canonical_camera(), io.BytesIO()
    np.save(file, box_depth_image(camera, boxes))
    depth = base64.b64encode(file.getvalue()).decode()
    return json.dumps({"depth": depth, "format": "npy", "camera": camera.to_dict()} | more).encode()


def without_times(content: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in content.items() if name != "timings_ms"}


def test_the_answer_is_the_plan_and_is_counted(planner: Planner) -> None:
    camera = canonical_camera()
    plan = planner.plan(box_depth_image(camera, (Box(x=0.02),)), camera, top=2, seed=3)
    with served(planner) as address:
        assert send(f"{address}/health") == (200, {"status": "ok"})
        status, content = send(f"{address}/plan", asked(top=2, seed=3))
        numbers = send(f"{address}/metrics")[1]
    assert status == (200 if plan.grasps else 422)
    assert without_times(content) == without_times(json.loads(json.dumps(plan.to_dict())))
    outcome = "grasp" if plan.grasps else "no_grasp"
    assert f'bayesgrasp_plans_total{{outcome="{outcome}"}} 1.0' in numbers
    assert "bayesgrasp_plan_seconds_count 1.0" in numbers


def test_twenty_clients_at_once_get_their_own_answers(planner: Planner) -> None:
    requests = [asked((Box(x=0.004 * k - 0.02, yaw=0.1 * k),), seed=k, top=1) for k in range(10)]
    service = PlanService(planner)
    alone = [service.answer(request).content for request in requests]
    service.close()
    assert len({json.dumps(without_times(content)) for content in alone}) == len(alone)
    with served(planner, ServiceLimits(workers=2)) as address, ThreadPoolExecutor(20) as clients:
        answers = list(clients.map(lambda k: send(f"{address}/plan", requests[k % 10])[1], range(20)))
    for k, content in enumerate(answers):
        assert without_times(content) == without_times(json.loads(json.dumps(alone[k % 10])))


def test_what_plan_refuses_is_refused_with_its_reason(planner: Planner) -> None:
    with served(planner) as address:
        status, content = send(f"{address}/plan", asked(()))
        assert status == 422
        assert "nothing on the table" in content["reason"]
        status, content = send(f"{address}/plan", asked(constraints={"lowest": 0.8}))
        assert status == 422
        assert "no hand keeps the constraints" in content["reason"]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"depth": "!"}, "base64"),
        ({"depth": ""}, "not an array of NumPy"),
        ({"format": "tiff"}, "format must be one of png, npy, npz"),
        ({"camera": {}}, "intrinsics"),
        ({"top": 0}, "top must be a whole number from 1"),
        ({"top": True}, "top must be a whole number"),
        ({"seed": -1}, "seed must be"),
        ({"lowest": 0.1}, "missing or unknown: lowest"),
        ({"constraints": {"lowst": 0.1}}, "missing or unknown: lowst"),
        ({"constraints": {"keep_out": [{"low": [0, 0], "high": [1, 1, 1]}]}}, "three numbers"),
        ({"constraints": {"keep_out": [{"low": [0, 0, 2], "high": [1, 1, 1]}]}}, "box needs low < high"),
        ({"constraints": {"grasp_types": ["fist"]}}, "a grasp type must be one of basic, wide, pinch"),
        ({"constraints": {"confidence": 0.9}}, "does not know what its plans deliver"),
    ],
)
def test_wrong_input_is_one_line(planner: Planner, more: dict[str, Any], words: str) -> None:
    service = PlanService(planner)
    answer = service.answer(asked(**more))
    service.close()
    assert answer.status == 400
    assert words in answer.content["error"]
    assert "\n" not in answer.content["error"]


def test_limits_of_size_of_number_and_of_time(planner: Planner, monkeypatch: pytest.MonkeyPatch) -> None:
    with served(planner, ServiceLimits(largest=1000)) as address:
        assert send(f"{address}/plan", bytes(1001))[0] == 413
        assert send(f"{address}/plan", b"{}")[0] == 400
    ready, started = threading.Event(), threading.Event()

    def wait(*_: object, **__: object) -> None:
        started.set()
        ready.wait(60)
        raise InvalidConfigurationError("waited")

    monkeypatch.setattr(Planner, "plan", wait)
    with served(planner, ServiceLimits(most_waiting=0)) as address, ThreadPoolExecutor(1) as first:
        slow = first.submit(send, f"{address}/plan", asked())
        assert started.wait(60)
        assert send(f"{address}/plan", asked())[0] == 503
        ready.set()
        assert slow.result() == (400, {"error": "waited"})
    ready.clear()
    with served(planner, ServiceLimits(longest=0.2)) as address:
        status, content = send(f"{address}/plan", asked())
        assert status == 504
        assert "within 0.2 s" in content["error"]
        ready.set()


def test_a_token_opens_everything_but_health(planner: Planner) -> None:
    with served(planner, token=TOKEN) as address:
        for path in ("plan", "metrics"):
            for sent in (None, "wrong"):
                assert send(f"{address}/{path}", token=sent)[0] == 401
        assert send(f"{address}/health")[0] == 200
        assert send(f"{address}/metrics", token=TOKEN)[0] == 200


def test_another_address_needs_a_token(tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    for host in ("127.0.0.1", "::1", "localhost"):
        check_token(host, None)
    for host in ("0.0.0.0", "::", "192.168.0.7", "robot"):
        check_token(host, TOKEN)
        with pytest.raises(InvalidConfigurationError, match="give --token-file"):
            check_token(host, None)
    (tmp_path / "token").write_text("short\n")
    for options in ([], ["--token-file", str(tmp_path / "token")]):
        with pytest.raises(SystemExit) as stopped:
            main(["serve", "--host", "0.0.0.0", *options])
        assert stopped.value.code == 2
        assert capsys.readouterr().err.startswith("error: ")
