#!/usr/bin/env python3
"""Runs the tests that depend on a driver on each driver that can be had, and prints a table.

    python3 tests/drivers/run.py [--driver NAME ...] [--short] [--cases N]

mesa         the machine's own Mesa (lavapipe)
width128     the same with vectors of 128 bits: subgroups of 4
width512     the same with vectors of 512 bits: subgroups of 16; only on processors with AVX-512
swiftshader  SwiftShader of Debian's package chromium-common, which is downloaded and unpacked, not installed
mesa25       Mesa 25 of Debian 13, in a chroot that debootstrap makes; needs root

A cell of the table says how many scenes or tests passed, and the seconds of processor time.
Drivers are kept in target/drivers. A driver that cannot be had is left out with a line that says why. The exit code is 1 if
something failed, and 3 if no driver could be had.
"""

import argparse
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

HOME = pathlib.Path(__file__).resolve().parent.parent.parent
CACHE = HOME / "target" / "drivers"
SUITES = ["render", "gradient", "modes", "embed"]
# The tests that the gate runs on SwiftShader besides `check`, which compares images and gradients with the model and
# their bits on repeat: one hazard of images, one of gradients.
SHORT = {
    "render": ["render::forward::log_weights"],
    "gradient": ["gradient::hazards::shared_edge"],
}


class Missing(Exception):
    """A driver that cannot be had, and why."""


class Driver:
    """How a program is run on a driver: variables of its environment, words before its command, and tests that it leaves out."""

    def __init__(self, environment, before=(), without=()):
        self.environment, self.before, self.without = environment, list(before), list(without)

    def run(self, command, limit):
        environment = {**os.environ, **self.environment}
        words = [*self.before, *(str(word) for word in command)]
        start = processor_time()
        try:
            done = subprocess.run(
                words, cwd=HOME, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=limit
            )
            code, output = done.returncode, done.stdout
        except subprocess.TimeoutExpired as late:
            code, output = "no end", (late.stdout or b"").decode(errors="replace")
        return code, output, processor_time() - start


def processor_time():
    """Seconds that the programs run so far took of the processors, whatever else the machine did."""
    times = os.times()
    return times.children_user + times.children_system


def mesa():
    return Driver({"SOFTRAS_DEVICE": "llvmpipe"})


def width128():
    # That example draws its own triangles with a graphics pipeline that corrupts the process's heap, with or without
    # softras.
    without = ["the_example_fits_its_vertex_and_draws_its_own"]
    return Driver({"SOFTRAS_DEVICE": "llvmpipe", "LP_NATIVE_VECTOR_WIDTH": "128"}, without=without)


def width512():
    if "avx512f" not in pathlib.Path("/proc/cpuinfo").read_text():
        raise Missing("the processor has no AVX-512")
    return Driver({"SOFTRAS_DEVICE": "llvmpipe", "LP_NATIVE_VECTOR_WIDTH": "512"})


def download(package, folder):
    """Unpacks a Debian package into a folder without installing it."""
    if not shutil.which("apt-get"):
        raise Missing("there is no apt-get to download it with")
    with tempfile.TemporaryDirectory() as into:
        os.chmod(into, 0o755)
        for attempt in ("as it is", "with new lists"):
            if attempt == "with new lists":
                subprocess.run([*as_root(), "apt-get", "-q", "update"], stdout=subprocess.DEVNULL)
            done = subprocess.run(["apt-get", "-q", "download", package], cwd=into, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            files = list(pathlib.Path(into).glob("*.deb"))
            if done.returncode == 0 and files:
                pathlib.Path(folder).parent.mkdir(parents=True, exist_ok=True)
                subprocess.run(["dpkg", "-x", files[0], folder], check=True)
                return
        raise Missing(f"apt-get download {package}: {done.stdout.strip().splitlines()[-1:]}")


def as_root():
    return [] if os.geteuid() == 0 else ["sudo", "-n"]


def swiftshader():
    folder = CACHE / "swiftshader"
    if not (folder / "vk_swiftshader_icd.json").is_file():
        with tempfile.TemporaryDirectory() as unpacked:
            download("chromium-common", unpacked)
            folder.mkdir(parents=True, exist_ok=True)
            # The description is written last: if it exists, the library exists too.
            for name in ("libvk_swiftshader.so", "vk_swiftshader_icd.json"):
                found = list(pathlib.Path(unpacked).rglob(name))
                if not found:
                    raise Missing(f"chromium-common holds no {name}")
                shutil.copy(found[0], folder / name)
    return Driver({"VK_ICD_FILENAMES": str(folder / "vk_swiftshader_icd.json"), "SOFTRAS_DEVICE": "SwiftShader"})


def mesa25():
    if os.geteuid() != 0:
        raise Missing("debootstrap and chroot need root")
    folder = CACHE / "trixie"
    if not (folder / "usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json").is_file():
        shutil.rmtree(folder, ignore_errors=True)
        tool = CACHE / "debootstrap"
        if not (tool / "usr/sbin/debootstrap").is_file():
            download("debootstrap", tool)
        command = ["sh", tool / "usr/sbin/debootstrap", "--variant=minbase", "--include=libvulkan1,mesa-vulkan-drivers,vulkan-validationlayers"]
        done = subprocess.run(
            [str(word) for word in [*command, "trixie", folder, "http://deb.debian.org/debian"]],
            env={**os.environ, "DEBOOTSTRAP_DIR": str(tool / "usr/share/debootstrap")},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        if done.returncode != 0:
            shutil.rmtree(folder, ignore_errors=True)
            raise Missing(f"debootstrap: {done.stdout.strip().splitlines()[-1:]}")
    inside = folder / str(HOME).lstrip("/")
    inside.mkdir(parents=True, exist_ok=True)
    # The mounts are in a namespace of their own, which ends with the command.
    script = f"""mount --bind '{HOME}' '{inside}' && mount --rbind /proc '{folder}/proc' && mount --rbind /dev '{folder}/dev' &&
        exec chroot '{folder}' sh -c 'cd "{HOME}" && exec "$@"' run "$@" """
    return Driver({"SOFTRAS_DEVICE": "llvmpipe"}, ["unshare", "--mount", "sh", "-c", script, "run"])


DRIVERS = {f.__name__: f for f in (mesa, width128, width512, swiftshader, mesa25)}


def built():
    """The programs, built as `cargo test` builds them: paths by name."""
    command = ["cargo", "test", "-q", "--no-run", "--message-format=json", "--test", "quick"]
    found = {}
    for line in subprocess.run(command, cwd=HOME, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines():
        message = json.loads(line)
        if message.get("executable") and message["target"]["name"] == "quick":
            found[message["target"]["name"]] = message["executable"]
    subprocess.run(["cargo", "build", "-q"], cwd=HOME, check=True)
    found["softras"] = HOME / "target" / "debug" / "softras"
    return found


def rows(programs, short, cases):
    """(name, command, the words that count what was done) of each row."""
    yield "check", [programs["softras"], "check"], r"PASS: (\d+) of"
    for suite in SUITES:
        if short and suite not in SHORT:
            continue
        words = SHORT[suite] if short else [suite + "::"]
        yield suite, [programs["quick"], *words], r"test result: ok\. (\d+) passed"
    if cases > 0:
        command = [programs["softras"], "stress", "--cases", cases, "--seed", 5000, "--batch", 16, "--jobs", 2]
        yield f"stress, {cases} scenes", command, r"(\d+) rendered and differentiated twice"


def cell(code, output, seconds, counted):
    """The text of a cell of the table, and whether it is good."""
    done = re.search(counted, output)
    if code == 0 and done and int(done[1]) > 0:
        return f"{done[1]} ok, {seconds:.0f} s", True
    failed = re.findall(r"^test (\S+) \.\.\. FAILED", output, re.MULTILINE)
    return ("FAILED: " + ", ".join(failed) if failed else f"FAILED ({code})"), False


def self_test():
    """A driver's failure must not look like success."""
    count = r"test result: ok\. (\d+) passed"
    good = "test result: ok. 7 passed; 0 failed"
    assert cell(0, good, 3.0, count) == ("7 ok, 3 s", True)
    assert cell(101, good, 3.0, count) == ("FAILED (101)", False)
    assert cell(0, "test result: ok. 0 passed; 0 failed", 3.0, count)[1] is False, "no test is no success"
    assert cell(101, "test a::b ... FAILED\ntest c ... ok", 3.0, count) == ("FAILED: a::b", False)
    assert cell("no end", "", 3.0, count) == ("FAILED (no end)", False)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--driver", action="append", choices=DRIVERS, help="only this driver; can be repeated")
    parser.add_argument("--short", action="store_true", help="`check` and a few tests")
    parser.add_argument("--cases", type=int, help="scenes of `softras stress` [default: 2000; with --short none]")
    parser.add_argument("--limit", type=int, default=3600, metavar="SECONDS", help="the most that a row may take")
    arguments = parser.parse_args()
    self_test()
    cases = arguments.cases if arguments.cases is not None else 0 if arguments.short else 2000
    programs = built()
    drivers, bad = {}, False
    for name in arguments.driver or DRIVERS:
        try:
            drivers[name] = DRIVERS[name]()
        except Missing as why:
            print(f"{name}: cannot be had: {why}")
    if not drivers:
        sys.exit(3)
    for name, driver in drivers.items():
        code, output, _ = driver.run([programs["softras"], "devices"], 60)
        print(f"{name}: " + "; ".join(line.strip() for line in output.strip().splitlines()), flush=True)
        bad = bad or code != 0
    table = []
    for row, command, counted in rows(programs, arguments.short, cases):
        cells = []
        for name, driver in drivers.items():
            left_out = [word for test in driver.without for word in ("--skip", test)] if row in SUITES else []
            code, output, seconds = driver.run([*command, *left_out], arguments.limit)
            text, good = cell(code, output, seconds, counted)
            if not good:
                bad = True
                print(f"--- {row} on {name}\n{output}", file=sys.stderr)
            print(f"{row} on {name}: {text}", file=sys.stderr, flush=True)
            cells.append(text)
        table.append([row, *cells])
    table.insert(0, ["", *drivers])
    widths = [max(len(line[i]) for line in table) for i in range(len(table[0]))]
    for line in table:
        print("  ".join(text.ljust(width) for text, width in zip(line, widths)).rstrip())
    sys.exit(int(bad))


if __name__ == "__main__":
    main()
