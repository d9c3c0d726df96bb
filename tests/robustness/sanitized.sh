#!/usr/bin/env bash
# Runs tests with all C code, the blocks and the engine, compiled by gcc with AddressSanitizer and UBSan.
#   sanitized.sh [PYTEST ARGUMENTS]     by default the property tests of the blocks and of the harness
set -euo pipefail
cd "$(dirname "$0")/../.."
[ $# -gt 0 ] || set -- -n 2 tests/blocks tests/fmi tests/harness
cache=$(mktemp -d)
trap 'rm -rf "$cache"' EXIT
export FRICTION_FMUS_CACHE="$cache"
# no -Werror: with sanitizers gcc guesses at values that cannot be
export CC="gcc -fsanitize=address,undefined -fno-sanitize-recover=all -Wno-error=maybe-uninitialized"
# Python itself does not free everything at its end; MiB of memory that a test asks for to be refused are no fault
export ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=1
LD_PRELOAD="$(gcc -print-file-name=libasan.so) $(gcc -print-file-name=libubsan.so)" \
    "${PYTHON:-python3}" -m pytest -p no:cacheprovider "$@"
