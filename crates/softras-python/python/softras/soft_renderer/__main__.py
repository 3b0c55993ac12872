"""Runs a program that was written for the official package: `python -m softras.soft_renderer SCRIPT.py ARGUMENTS`, or
`python -m softras.soft_renderer -m MODULE ARGUMENTS`. See `install` for what is different for the program.
"""

from __future__ import annotations

import os
import runpy
import sys

from .install import install


def main() -> int:
    arguments = sys.argv[1:]
    as_module = arguments[:1] == ["-m"]
    sys.argv = arguments[1:] if as_module else arguments
    if not sys.argv:
        print("usage: python -m softras.soft_renderer [-m] SCRIPT.py|MODULE [ARGUMENTS]", file=sys.stderr)
        return 2
    install()
    if as_module:
        sys.path.insert(0, os.getcwd())
        runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
    else:
        sys.path.insert(0, os.path.dirname(os.path.abspath(sys.argv[0])))
        runpy.run_path(sys.argv[0], run_name="__main__")
    return 0


if __name__ == "__main__":
    sys.exit(main())
