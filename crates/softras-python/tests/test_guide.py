"""The programs of docs/python.md and README.md run as they are printed, those of one package after those of numpy."""

import importlib.util
import os
import pathlib
import re
import subprocess
import sys

import pytest

HERE = pathlib.Path(__file__).parent
#: Beside the tests where test.sh has put them, or in the repository.
FOLDERS = [HERE, *list(HERE.parents)[2:3]]


def text_of(page):
    """The text of a page of the repository."""
    found = [path for folder in FOLDERS for path in (folder / page.split("/")[-1], folder / page) if path.is_file()]
    if not found:
        pytest.skip(f"{page} is not there")
    return found[0].read_text(encoding="utf-8")


def programs_of(text):
    """The Python programs of a text."""
    return re.findall(r"^```python\n(.*?)^```", text, flags=re.M | re.S)


def run(program, folder, package):
    """Runs a program that needs a package."""
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"{package} is not installed: test.sh --with {package} adds it")
    (folder / "guide.py").write_text(program, encoding="utf-8")
    command = [sys.executable, "guide.py"]
    result = subprocess.run(command, cwd=folder, env=dict(os.environ), capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr


@pytest.fixture(scope="module")
def programs():
    """The programs below each heading of the guide."""
    parts = re.split(r"^(?=## )", text_of("docs/python.md"), flags=re.M)
    return {part.splitlines()[0].lstrip("# "): programs_of(part) for part in parts}


def test_the_readme_runs(tmp_path):
    programs = programs_of(text_of("README.md"))
    assert programs
    run("\n".join(programs), tmp_path, "torch")


@pytest.mark.parametrize(
    "heading, package",
    [
        ("Arrays", "numpy"),
        ("Pictures, and meshes from pictures", "numpy"),
        ("torch", "torch"),
        ("A mesh, then its texture", "torch"),
        ("JAX", "jax"),
        ("The official package's interface", "torch"),
    ],
)
def test_the_guide_runs(programs, heading, package, tmp_path):
    names = dict.fromkeys(["Arrays", *["torch"] * (heading == "A mesh, then its texture"), heading])
    parts = [part for name in names for part in programs[name]]
    assert programs[heading]
    run("\n".join(parts), tmp_path, package)
