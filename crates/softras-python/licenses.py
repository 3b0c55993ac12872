#!/usr/bin/env python3
"""Prints the licences of softras and of all that is linked into the wheel, as cargo knows them."""

import json
import pathlib
import subprocess

HERE = pathlib.Path(__file__).parent


def main() -> None:
    command = ["cargo", "tree", "--package", "softras-python", "--edges", "normal", "--prefix", "none", "--format", "{p}"]
    linked = {tuple(line.split()[:2]) for line in subprocess.check_output(command, cwd=HERE, text=True).splitlines() if line}
    command = ["cargo", "metadata", "--format-version", "1", "--locked"]
    packages = json.loads(subprocess.check_output(command, cwd=HERE, text=True))["packages"]
    printed: dict = {}
    for package in sorted(packages, key=lambda package: package["name"]):
        if (package["name"], "v" + package["version"]) not in linked:
            continue
        print(f"\n==== {package['name']} {package['version']}: {package['license']} {package['repository'] or ''}\n")
        folder = pathlib.Path(package["manifest_path"]).parent
        own = [folder, folder.parent.parent] if package["source"] is None else [folder]
        files = [path for place in own for path in sorted(place.iterdir()) if path.name.upper().startswith(("LICEN", "COPYING"))]
        for path in (path for path in files if path.is_file()):
            text = path.read_text(encoding="utf-8", errors="replace")
            # Most have the same text, which is printed once.
            first = printed.setdefault(" ".join(text.split()), package["name"])
            print(text if first == package["name"] else f"{path.name}: as of {first}")


if __name__ == "__main__":
    main()
