#!/usr/bin/env bash
# Runs tests with all C code, the blocks and the engine, compiled by gcc with sanitizers.
#   sanitized.sh address|thread [PYTEST ARGUMENTS]
#     address   AddressSanitizer and UBSan
#     thread    ThreadSanitizer
#     the tests are by default the property tests of the blocks and of the harness
set -euo pipefail
cd "$(dirname "$0")/../.."
python=${PYTHON:-python3}
case "${1:-}" in
address)
    sanitizer=address,undefined
    libraries="libasan.so libubsan.so"
    runner=()
    # Python does not free everything at its end; memory that a test asks for to be refused is no fault
    export ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=1
    ;;
thread)
    sanitizer=thread
    libraries=libtsan.so
    # without random addresses, which gcc's TSan does not find its shadow for
    runner=(setarch -R)
    # threads of numpy's BLAS are not ours
    export OPENBLAS_NUM_THREADS=1 TSAN_OPTIONS=halt_on_error=1:exitcode=66
    ;;
*)
    sed -n '2,7s/^# \{0,1\}//p' "$0" >&2
    exit 2
    ;;
esac
shift
[ $# -gt 0 ] || set -- -n 2 tests/blocks tests/fmi tests/harness
cache=$(mktemp -d)
trap 'rm -rf "$cache"' EXIT
export FRICTION_FMUS_CACHE="$cache"
# no -Werror: with sanitizers gcc guesses at values that cannot be
export CC="gcc -fsanitize=$sanitizer -fno-sanitize-recover=all -Wno-error=maybe-uninitialized"
preload=""
for library in $libraries; do preload+="$(gcc -print-file-name="$library") "; done
LD_PRELOAD="${preload% }" "${runner[@]}" "$python" -m pytest -p no:cacheprovider "$@"
