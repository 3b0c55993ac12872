"""The programs of docs/python.md run as they are printed, those of one package after those of numpy."""

import importlib.util
import os
import pathlib
import re
import subprocess
import sys

import pytest

HERE = pathlib.Path(__file__).parent
#: Beside the tests where test.sh has put it, or in the repository.
GUIDES = [HERE / "python.md", HERE.parents[2] / "docs" / "python.md"] if len(HERE.parents) > 2 else [HERE / "python.md"]


@pytest.fixture(scope="module")
def programs():
    """The programs below each heading."""
    guide = next((path for path in GUIDES if path.is_file()), None)
    if guide is None:
        pytest.skip("docs/python.md is not there")
    found, heading = {}, ""
    for part in re.split(r"^(?=## )", guide.read_text(encoding="utf-8"), flags=re.M):
        heading = part.splitlines()[0].lstrip("# ")
        found[heading] = re.findall(r"^```python\n(.*?)^```", part, flags=re.M | re.S)
    return found


@pytest.mark.parametrize(
    "heading, package",
    [
        ("Arrays", "numpy"),
        ("Pictures, and meshes from pictures", "numpy"),
        ("torch", "torch"),
        ("JAX", "jax"),
        ("The official package's interface", "torch"),
    ],
)
def test_the_guide_runs(programs, heading, package, tmp_path):
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"{package} is not installed: test.sh --with {package} adds it")
    parts = programs["Arrays"] + (programs[heading] if heading != "Arrays" else [])
    assert programs[heading]
    (tmp_path / "guide.py").write_text("\n".join(parts), encoding="utf-8")
    command = [sys.executable, "guide.py"]
    result = subprocess.run(command, cwd=tmp_path, env=dict(os.environ), capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr
