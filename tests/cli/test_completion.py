"""The script for a shell: bash itself completes with it, and nothing heavy is imported to make it."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CODE = (
    "import sys; from bayesgrasp.cli.main import main\n"
    "try:\n    main(['completion', sys.argv[1]])\n"
    "finally:\n    print([name for name in ('torch', 'mujoco', 'numba') if name in sys.modules], file=sys.stderr)"
)


def script(shell: str) -> tuple[str, str]:
    done = subprocess.run([sys.executable, "-c", CODE, shell], capture_output=True, text=True, check=True)
    return done.stdout, done.stderr.splitlines()[-1]


@pytest.fixture(scope="module")
def bash(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The script for bash in a file."""
    text, heavy = script("bash")
    assert heavy == "[]"
    path = tmp_path_factory.mktemp("completion") / "bayesgrasp.bash"
    path.write_text(text)
    return path


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash")
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (("pla",), {"plan"}),
        (("objects", ""), {"list", "show", "fetch"}),
        (("objects", "list", "--spl"), {"--split"}),
        (("plan", "--samples"), {"--samples", "--samples-out"}),
        (("plan", "--rank", ""), {"success", "held", "posterior"}),
    ],
)
def test_bash_completes(bash: Path, typed: tuple[str, ...], offered: set[str]) -> None:
    words = " ".join(f"'{word}'" for word in ("bayesgrasp", *typed))
    ask = f'. "$0"; COMP_WORDS=({words}); COMP_CWORD={len(typed)}; _tyro_bayesgrasp; printf "%s\\n" "${{COMPREPLY[@]}}"'
    path = f"{Path(sys.executable).parent}:/usr/bin:/bin"
    done = subprocess.run(["bash", "-c", ask, bash], capture_output=True, text=True, check=True, env={"PATH": path})
    assert set(done.stdout.split()) >= offered
    assert "demo" not in done.stdout


def test_zsh_has_a_script_too() -> None:
    assert script("zsh")[0].startswith("#compdef bayesgrasp")
