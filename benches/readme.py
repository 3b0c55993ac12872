#!/usr/bin/env python3
"""Measures again what README.md shows, and writes it there: python3 benches/readme.py [WORD]

Each block of figures in README.md stands behind a comment <!-- run: COMMAND -->, whose output it is. With a word, only the
commands that have it in them are run.
"""

import pathlib
import re
import subprocess
import sys

HOME = pathlib.Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"(<!-- run: (.*?) -->\n+```text\n).*?(```)", re.DOTALL)


def measured(block):
    head, command, end = block.groups()
    if len(sys.argv) > 1 and sys.argv[1] not in command:
        return block.group(0)
    print(command, file=sys.stderr)
    done = subprocess.run(command, shell=True, cwd=HOME, check=True, stdout=subprocess.PIPE, text=True)
    return head + done.stdout.strip("\n") + "\n" + end


readme = HOME / "README.md"
readme.write_text(BLOCK.sub(measured, readme.read_text()))
