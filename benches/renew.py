#!/usr/bin/env python3
"""Measures the figures of docs/ again and writes them there: python3 benches/renew.py [WORD]

Each block of figures follows a comment <!-- run: COMMAND --> and is the output of that command. With a word, only the
commands that contain it are run. A command is run until two runs in a row agree: nine of ten figures differ by at most
15 %. A block whose runs never agree stays as it is.
"""

import pathlib
import re
import subprocess
import sys

HOME = pathlib.Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"(<!-- run: ([^\n]*) -->\n+```text\n).*?(```)", re.DOTALL)
FIGURE = re.compile(r"\d+\.\d+(?:e-?\d+)?")
RUNS, SPREAD = 6, 0.15


def run(command):
    return subprocess.run(command, shell=True, cwd=HOME, check=True, stdout=subprocess.PIPE, text=True).stdout.strip("\n")


def agree(first, second):
    pairs = list(zip(FIGURE.findall(first), FIGURE.findall(second)))
    apart = [abs(float(a) - float(b)) > SPREAD * max(float(a), float(b)) for a, b in pairs]
    return sum(apart) <= len(pairs) / 10


def measured(block):
    head, command, end = block.groups()
    if len(sys.argv) > 1 and sys.argv[1] not in command:
        return block.group(0)
    print(command, file=sys.stderr)
    last = run(command)
    for _ in range(RUNS - 1):
        last, before = run(command), last
        if agree(last, before):
            return head + last + "\n" + end
    print(f"disturbed in {RUNS} runs, left as it is: {command}", file=sys.stderr)
    return block.group(0)


for page in sorted((HOME / "docs").glob("*.md")):
    page.write_text(BLOCK.sub(measured, page.read_text()))
