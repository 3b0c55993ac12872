#!/usr/bin/env python3
"""Measures the figures of docs/ again and writes them there: python3 benches/renew.py [WORD]

Each block of figures follows a comment <!-- run: COMMAND --> and is the output of that command. With a word, only the
commands that contain it are run.
"""

import pathlib
import re
import subprocess
import sys

HOME = pathlib.Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"(<!-- run: ([^\n]*) -->\n+```text\n).*?(```)", re.DOTALL)


def measured(block):
    head, command, end = block.groups()
    if len(sys.argv) > 1 and sys.argv[1] not in command:
        return block.group(0)
    print(command, file=sys.stderr)
    done = subprocess.run(command, shell=True, cwd=HOME, check=True, stdout=subprocess.PIPE, text=True)
    return head + done.stdout.strip("\n") + "\n" + end


for page in sorted((HOME / "docs").glob("*.md")):
    page.write_text(BLOCK.sub(measured, page.read_text()))
