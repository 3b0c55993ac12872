#!/usr/bin/env bash
# Builds the wheel, installs it in a fresh virtual environment with numpy and pytest, and runs the tests. Pillow is there too,
# for the examples, which are tested with smaller numbers.
#
# Usage: test.sh [--profile PROFILE] [--with PACKAGE]...
#   --with torch adds torch, of which the tests of softras.torch and softras.soft_renderer need some 5 GB from PyPI;
#   --with jax adds JAX, some 100 MB, for those of softras.jax;
#   --with trimesh --with scipy is for the second reader of test_strangers.py;
#   --with mypy checks the types (with torch), --with tqdm draws bars;
#   --with matplotlib is for the notebook (with torch), and --with 'ray[data]', some 600 MB, for folder.py --ray.
# Exit code 3: Python, its module venv or the packages cannot be had here.
set -euo pipefail
cd "$(dirname "$0")"

profile=dev
packages=()
while [ $# -gt 0 ]; do
    case $1 in
    --profile) profile=$2 ;;
    --with) packages+=("$2") ;;
    *)
        echo "test.sh: unknown argument $1" >&2
        exit 2
        ;;
    esac
    shift 2
done

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
unavailable() {
    echo "not run: $1" >&2
    exit 3
}
command -v python3 >/dev/null || unavailable "python3 is absent"
python3 -m venv "$scratch/build" || unavailable "python3 has no module venv (Debian: python3-venv)"
"$scratch/build/bin/pip" install --quiet "maturin>=1.9,<2" || unavailable "maturin cannot be installed"
# The command, with whose fits those of Python are compared.
cargo build --quiet --locked --profile "$profile" --manifest-path ../../Cargo.toml -p softras-cli
target=$(cargo metadata --format-version 1 --no-deps | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')
SOFTRAS_COMMAND=$target/$([ "$profile" = dev ] && echo debug || echo "$profile")/softras
export SOFTRAS_COMMAND
# By the tool of one environment, as `pip install .` builds it, so that the wheel is tested in another one that has never seen the source.
PATH=$scratch/build/bin:$PATH pip wheel --quiet --no-deps --no-build-isolation \
    --config-settings "build-args=--locked --profile $profile" --wheel-dir "$scratch/wheels" .

python3 -m venv "$scratch/clean"
"$scratch/clean/bin/pip" install --quiet pytest numpy pillow "${packages[@]}" || unavailable "pytest, numpy or Pillow cannot be installed"
"$scratch/clean/bin/pip" install --quiet --no-index "$scratch"/wheels/softras-*.whl
if [ -z "${SOFTRAS_RECORDED:-}" ] && [ -d ../../../shared/reference ]; then
    SOFTRAS_RECORDED=$(cd ../../../shared/reference && pwd)
    export SOFTRAS_RECORDED
fi
cp -r tests "$scratch/tests"
# Their programs are tests too.
cp -r examples ../../docs/python.md ../../README.md "$scratch/tests/"
cd "$scratch"
"$scratch/clean/bin/python" -m pytest -q -rs --durations=3 tests
