#!/usr/bin/env bash
# Builds what is published into dist/: wheels for Linux (manylinux_2_17, x86-64 and aarch64) and the source distribution.
#
# Usage: wheels.sh [--profile PROFILE] [TARGET]...
#   The targets are x86_64-unknown-linux-gnu and aarch64-unknown-linux-gnu unless given. zig, from PyPI, links against the old C
#   library; the kernels are those of glsl/spirv. macOS and Windows: wheels.yml, a workflow of a forge.
set -euo pipefail
cd "$(dirname "$0")"

profile=release
[ "${1:-}" != --profile ] || { profile=$2; shift 2; }
targets=("$@")
[ "$#" -gt 0 ] || targets=(x86_64-unknown-linux-gnu aarch64-unknown-linux-gnu)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"; rm -f python/softras/LICENSES.txt' EXIT
python3 -m venv "$scratch"
"$scratch/bin/pip" install --quiet "maturin>=1.9,<2" ziglang twine
export SOFTRAS_SPIRV=packaged PATH=$scratch/bin:$PATH
python3 backend.py
for target in "${targets[@]}"; do
    rustup target add --toolchain "$(rustup show active-toolchain | cut -d' ' -f1)" "$target"
    maturin build --locked --profile "$profile" --zig --target "$target" --compatibility manylinux_2_17 --out dist
done
maturin sdist --out dist
twine check --strict dist/*
