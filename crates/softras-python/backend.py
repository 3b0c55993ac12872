#!/usr/bin/env python3
"""The build backend of the package: maturin, and a file with the licences of softras and of all that is linked in, as cargo knows them.

As a program it writes the file alone.
"""

import json
import pathlib
import subprocess

import maturin
from maturin import *  # noqa: F403: the hooks that need no licences

HERE = pathlib.Path(__file__).parent


def texts():
    """The lines of the file."""
    command = ["cargo", "tree", "--package", "softras-python", "--edges", "normal", "--prefix", "none", "--format", "{p}"]
    linked = {tuple(line.split()[:2]) for line in subprocess.check_output(command, cwd=HERE, text=True).splitlines() if line}
    command = ["cargo", "metadata", "--format-version", "1", "--locked"]
    packages = json.loads(subprocess.check_output(command, cwd=HERE, text=True))["packages"]
    printed: dict = {}
    for package in sorted(packages, key=lambda package: package["name"]):
        if (package["name"], "v" + package["version"]) not in linked:
            continue
        yield f"\n==== {package['name']} {package['version']}: {package['license']} {package['repository'] or ''}\n"
        folder = pathlib.Path(package["manifest_path"]).parent
        own = [folder, folder.parent.parent] if package["source"] is None else [folder]
        files = [path for place in own for path in sorted(place.iterdir()) if path.name.upper().startswith(("LICEN", "COPYING"))]
        for path in (path for path in files if path.is_file()):
            text = path.read_text(encoding="utf-8", errors="replace")
            # Most have the same text, which is printed once.
            first = printed.setdefault(" ".join(text.split()), package["name"])
            yield text if first == package["name"] else f"{path.name}: as of {first}"


def write() -> None:
    target = HERE / "python" / "softras" / "LICENSES.txt"
    # A source distribution has the file.
    if target.parent.is_dir():
        target.write_text("\n".join(texts()) + "\n", encoding="utf-8")


def build_wheel(*given, **named):
    write()
    return maturin.build_wheel(*given, **named)


def build_sdist(*given, **named):
    write()
    return maturin.build_sdist(*given, **named)


if __name__ == "__main__":
    write()
