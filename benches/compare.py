#!/usr/bin/env python3
"""Times two commits of this repository in turn and prints medians and ratios.

    python3 benches/compare.py OLD NEW [--only WORD ...] [--quick]

OLD and NEW are commits, or `.` for the files as they are. Each commit is unpacked and built once, into target/compare.
For each row one process of either commit stays open, and they are asked for a few frames in turn, so that what else the
machine does hits both. A frame is forward and backward by `Renderer`. The meshes of ../shared/meshes and the task of
../shared/silhouette8 are taken where they are there; without them the built-in fish stands for spot, and the task is left
out. A ratio below 1 means that NEW is faster.
"""

import argparse
import dataclasses
import math
import os
import pathlib
import shutil
import statistics
import subprocess
import sys

HOME = pathlib.Path(__file__).resolve().parent.parent
SHARED = HOME.parent / "shared"
CACHE = HOME / "target" / "compare"


@dataclasses.dataclass
class Row:
    """A line of the table: what `frames` is asked for, frames of a turn, and turns."""

    name: str
    mesh: str
    size: int
    mode: str
    views: int = 1
    sigma: str = "1e-4"
    frames: int = 5
    turns: int = 10
    environment: dict = dataclasses.field(default_factory=dict)


BOTH, SILHOUETTE = "color+silhouette", "silhouette"
MILLION = "8"
ROWS = [
    Row("spot 64 color+silhouette", "spot", 64, BOTH),
    Row("spot 256 color+silhouette", "spot", 256, BOTH),
    Row("spot 512 color+silhouette", "spot", 512, BOTH, frames=3),
    Row("spot 256 silhouette", "spot", 256, SILHOUETTE),
    Row("spot 512 silhouette", "spot", 512, SILHOUETTE, frames=3),
    Row("sphere 1280, 64 x 16 views, silhouette", "3", 64, SILHOUETTE, views=16),
    Row("silhouette8, a whole step", "task", 0, SILHOUETTE, turns=3),
    Row("1310720 faces 1024 color+silhouette, sigma 1e-5", MILLION, 1024, BOTH, sigma="1e-5", frames=1, turns=5),
    Row("1310720 faces 1024 color+silhouette, sigma 1e-4", MILLION, 1024, BOTH, frames=1, turns=1),
    Row("spot 256 color+silhouette, LP_NUM_THREADS=0", "spot", 256, BOTH, environment={"LP_NUM_THREADS": "0"}),
]

NPYZ = 'npyz = { version = "0.9", default-features = false, features = ["npz"] }'
MANIFEST = """[package]
name = "compare"
version = "0.0.0"
edition = "2024"

[dependencies]
softras = {{ path = "{source}", default-features = false, features = [{features}] }}
glam = "*"
{arrays}

[[bin]]
name = "frames"
path = "{frames}"

[[bin]]
name = "silhouette8"
path = "{silhouette8}"

[profile.release]
lto = "thin"
codegen-units = 4

[workspace]
"""


class Build:
    """A commit with its programs."""

    def __init__(self, commit):
        self.name = commit
        if commit == ".":
            self.folder, source = CACHE / "files", HOME
        else:
            full = run(["git", "rev-parse", "--verify", commit + "^{commit}"]).strip()
            self.folder = CACHE / full[:12]
            source = self.folder / "source"
            unpack(full, source)
        self.package = self.folder / "package"
        # Crates that silhouette8 of the commit takes; before there were any, it read its task with npyz.
        crates = [source / "crates" / f"softras-{name}" for name in ("check", "lab", "io", "fit")]
        arrays = [f'{crate.name} = {{ path = "{crate}" }}' for crate in crates if crate.is_dir()] or [NPYZ]
        own = crates[-1] / "benches" / "silhouette8.rs"
        self.package.mkdir(parents=True, exist_ok=True)
        known = (source / "Cargo.toml").read_text()
        # Before there was a workspace, the renderer and the fits were no features.
        features = [name for name in ("renderer", "fit", "obj") if f"\n{name} = [" in known]
        (self.package / "Cargo.toml").write_text(
            MANIFEST.format(
                source=source,
                silhouette8=own if own.is_file() else source / "benches" / "silhouette8.rs",
                arrays="\n".join(arrays),
                frames=HOME / "benches" / "compare" / "frames.rs",
                features=", ".join(f'"{name}"' for name in features),
            )
        )
        # The lock file has the versions of the dependencies that the commit's own programs have.
        shutil.copy(source / "Cargo.lock", self.package / "Cargo.lock")
        # The task is looked for beside the package.
        link = self.folder / "shared"
        if not link.is_symlink():
            link.symlink_to(SHARED)
        print(f"building {commit}", file=sys.stderr)
        target = self.folder / "target"
        run(["cargo", "build", "-q", "--release", "--target-dir", target], cwd=self.package)
        self.programs = target / "release"


def run(command, **options):
    return subprocess.run([str(word) for word in command], check=True, stdout=subprocess.PIPE, text=True, **{"cwd": HOME, **options}).stdout


def unpack(commit, source):
    """A commit's files, once. They are moved into place when all are there."""
    if source.exists():
        return
    unfinished = source.with_name("unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    unfinished.mkdir(parents=True)
    archive = subprocess.Popen(["git", "archive", commit], cwd=HOME, stdout=subprocess.PIPE)
    subprocess.run(["tar", "-x", "-C", unfinished], stdin=archive.stdout, check=True)
    if archive.wait() != 0:
        sys.exit(f"git archive {commit} failed")
    unfinished.rename(source)


class Refused(Exception):
    """A program that ended with an error; its message."""


class Worker:
    """An open program that times frames when it is asked."""

    def __init__(self, build, row):
        command = [build.programs / "frames", mesh_path(row.mesh), row.size, row.mode, row.views, row.sigma]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(
            [str(word) for word in command], stdin=pipe, stdout=pipe, stderr=pipe, text=True, env={**os.environ, **row.environment}
        )
        self.answer()

    def answer(self):
        line = self.process.stdout.readline()
        if not line:
            message = self.process.stderr.read().strip()
            self.close()
            raise Refused(message.splitlines()[-1] if message else "it ended without a word")
        return line.split()

    def turn(self, frames):
        """(wall, processors) of each frame, milliseconds."""
        self.process.stdin.write(f"{frames}\n")
        self.process.stdin.flush()
        numbers = [float(word) for word in self.answer()]
        return list(zip(numbers[::2], numbers[1::2]))

    def close(self):
        self.process.stdin.close()
        self.process.wait()


class Task:
    """The benchmark silhouette8, run until it has told its first fit's step."""

    def __init__(self, build, row):
        self.command = [str(build.programs / "silhouette8")]
        self.folder = build.package

    def turn(self, _):
        process = subprocess.Popen(self.command, cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for line in process.stdout:
            words = line.split()
            if words[:1] == ["step"]:
                process.terminate()
                process.wait()
                return [(float(words[1]), math.nan)]
        raise Refused((process.stderr.read().strip() or "it told no step").splitlines()[-1])

    def close(self):
        pass


def mesh_path(name):
    path = SHARED / "meshes" / f"{name}.obj"
    if name != "spot":
        return name
    return path if path.is_file() else "fish"


def turns(workers, row, count):
    """Each worker's turns, one worker after the other; who begins changes from turn to turn."""
    found = [[] for _ in workers]
    for turn in range(count):
        order = range(len(workers)) if turn % 2 == 0 else reversed(range(len(workers)))
        for i in order:
            found[i].append(workers[i].turn(row.frames))
    return found


def summary(old, new):
    """From the (wall, processors) of all turns: the medians of wall time, their ratio, the lowest and the highest ratio of
    a turn's medians, and the ratio of the medians of processor time."""

    def medians(of_turns, which):
        every = statistics.median(frame[which] for turn in of_turns for frame in turn)
        return every, [statistics.median(frame[which] for frame in turn) for turn in of_turns]

    (old_wall, old_turns), (new_wall, new_turns) = medians(old, 0), medians(new, 0)
    ratios = [b / a for a, b in zip(old_turns, new_turns)]
    processors = medians(new, 1)[0] / medians(old, 1)[0]
    return old_wall, new_wall, new_wall / old_wall, min(ratios), max(ratios), processors


def line(row, builds, quick):
    """A row of the table as text."""
    if row.mesh == "task" and not (SHARED / "silhouette8" / "task.npz").is_file():
        return f"{row.name:48} left out: there is no ../shared/silhouette8/task.npz"
    opened, refused = [], []
    for build in builds:
        try:
            opened.append((Task if row.mesh == "task" else Worker)(build, row))
        except Refused as why:
            refused.append(f"{build.name}: {why}")
    try:
        found = turns(opened, row, max(1, row.turns // 5) if quick else row.turns)
    except Refused as why:
        return f"{row.name:48} {why}"
    finally:
        for worker in opened:
            worker.close()
    if refused:
        times = [statistics.median(frame[0] for turn in of_turns for frame in turn) for of_turns in found]
        return f"{row.name:48} " + "; ".join(refused + [f"the other: {time:.2f} ms" for time in times])
    old, new, ratio, low, high, processors = summary(*found)
    shown = "-" if math.isnan(processors) else f"{processors:.2f}"
    return f"{row.name:48} {old:>9.2f} {new:>9.2f} {ratio:>6.2f} {f'{low:.2f}-{high:.2f}':>11} {shown:>10}"


def self_test():
    """Feeds the arithmetic with times whose answers are known, among them wrong ones that it must not give."""
    old = [[(10.0, 20.0), (11.0, 21.0), (90.0, 22.0)], [(10.0, 20.0), (12.0, 21.0), (11.0, 22.0)]]
    half = [[(wall / 2, 3 * processors) for wall, processors in turn] for turn in old]
    assert summary(old, half) == (11.0, 5.5, 0.5, 0.5, 0.5, 3.0), summary(old, half)
    assert summary(half, old)[2] == 2.0, "the ratio is NEW by OLD"
    # One turn under load moves the highest ratio and not the median.
    slow = [half[0], [(100.0, 63.0)] * 3]
    assert summary(old, slow)[3:5] == (0.5, 100.0 / 11.0)

    class Told:
        def __init__(self, name, log):
            self.name, self.log = name, log

        def turn(self, frames):
            self.log.append(self.name)
            return [(1.0, 1.0)] * frames

    log = []
    found = turns([Told("old", log), Told("new", log)], ROWS[0], 3)
    assert log == ["old", "new", "new", "old", "old", "new"], log
    assert [len(worker) for worker in found] == [3, 3] and len(found[0][0]) == ROWS[0].frames
    print("compare.py: the arithmetic is right")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commits", nargs="*", metavar="COMMIT", help="OLD and NEW")
    parser.add_argument("--only", action="append", metavar="WORD", help="only rows whose names contain it; can be repeated")
    parser.add_argument("--quick", action="store_true", help="a fifth of the turns, without the million faces")
    parser.add_argument("--self-test", action="store_true", help="check the arithmetic and build nothing")
    arguments = parser.parse_args()
    if arguments.self_test:
        return self_test()
    if len(arguments.commits) != 2:
        parser.error("give two commits: OLD NEW")
    rows = [row for row in ROWS if not arguments.only or any(word in row.name for word in arguments.only)]
    if arguments.quick:
        rows = [row for row in rows if row.mesh != MILLION]
    if not rows:
        parser.error("no row has such a name: " + "; ".join(row.name for row in ROWS))
    builds = [Build(commit) for commit in arguments.commits]
    if mesh_path("spot") == "fish":
        print("spot is not there: the fish instead")
    names = [build.name[:9] for build in builds]
    print(f"{'median of a frame, milliseconds':48} {names[0]:>9} {names[1]:>9} {'ratio':>6} {'turns':>11} {'processors':>10}")
    for row in rows:
        print(line(row, builds, arguments.quick), flush=True)


if __name__ == "__main__":
    main()
