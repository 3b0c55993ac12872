"""Programs that use every public function are typed: `mypy --strict`."""

import importlib.util
import pathlib
import subprocess
import sys

import pytest

import softras

HERE = pathlib.Path(__file__).parent


@pytest.mark.parametrize("program, package", [("typed.py", "numpy"), ("typed_torch.py", "torch")])
def test_mypy_finds_nothing(program, package, tmp_path):
    for needed in ("mypy", package):
        if importlib.util.find_spec(needed) is None:
            pytest.skip(f"{needed} is not installed: test.sh --with {needed} adds it")
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path), str(HERE / program)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert result.returncode == 0, result.stdout + result.stderr


def test_the_program_uses_every_name():
    text = (HERE / "typed.py").read_text(encoding="utf-8")
    assert [name for name in softras.__all__ if f"softras.{name}" not in text] == []


def test_the_program_runs(tmp_path):
    # Its types are true.
    pytest.importorskip("tqdm", reason="tqdm is not installed: test.sh --with tqdm adds it")
    code = "import sys, typed; typed.everything(sys.argv[1])"
    result = subprocess.run([sys.executable, "-c", code, str(tmp_path)], cwd=HERE, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr
