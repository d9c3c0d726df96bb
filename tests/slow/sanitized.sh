#!/usr/bin/env bash
# Runs tests with all C code, the blocks and the engine, compiled by gcc with sanitizers.
#   sanitized.sh address|thread [PYTEST ARGUMENTS]
#     address   AddressSanitizer and UBSan
#     thread    ThreadSanitizer
#     the tests are by default the property tests of blocks, composites and harness
set -euo pipefail
cd "$(dirname "$0")/../.."
python=${PYTHON:-python3}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
case "${1:-}" in
address)
    sanitizer=address,undefined
    libraries="libasan.so libubsan.so"
    runner=()
    tests=(tests/harness)
    # Python does not free everything at its end; memory that a test asks for to be refused is no fault; ecos
    # deletes an object of its own by a wrong type; tests of dying processes want the signal and not a report
    ASAN_OPTIONS=detect_leaks=0:allocator_may_return_null=1:new_delete_type_mismatch=0
    export ASAN_OPTIONS=$ASAN_OPTIONS:handle_segv=0:handle_abort=0
    ;;
thread)
    sanitizer=thread
    libraries=libtsan.so
    # without random addresses, which gcc's TSan does not find its shadow for
    runner=(setarch -R)
    # without processes and libraries that have threads of their own, which it cannot follow
    tests=(tests/harness/test_{engine,extrapolation,drive,harness_*,manipulators,newton*}.py)
    # races within other libraries are not ours; our code has no locks, and libarrow has more than the detector counts
    printf '%s\n' race:{libarrow,libscipy_openblas} >"$scratch/suppressions"
    TSAN_OPTIONS=allocator_may_return_null=1:detect_deadlocks=0:exitcode=0:log_path=$scratch/report
    export TSAN_OPTIONS=$TSAN_OPTIONS:suppressions=$scratch/suppressions
    ;;
*)
    sed -n '2,7s/^# \{0,1\}//p' "$0" >&2
    exit 2
    ;;
esac
shift
# sanitizers keep back what is freed, so the growth of memory is watched without them, also by the check of an FMU
blocks=(tests/{models,shell,every_block,composite,exchange} tests/slow/test_long_steps.py)
# casadi loads its parts with RTLD_DEEPBIND, which AddressSanitizer refuses
[ $# -gt 0 ] || set -- -n 2 --ignore tests/exchange/test_casadi.py "${blocks[@]}" "${tests[@]}" -k "not leave_no_memory_behind and not memory_does_not_grow and not check_finds_nothing and not terminals_that"
export FRICTION_FMUS_CACHE="$scratch/cache"
# no -Werror: with sanitizers gcc guesses at values that cannot be
export CC="gcc -fsanitize=$sanitizer -fno-sanitize-recover=all -Wno-error=maybe-uninitialized"
preload=""
for library in $libraries; do preload+="$(gcc -print-file-name="$library") "; done
status=0
LD_PRELOAD="${preload% }" "${runner[@]}" "$python" -m pytest -p no:cacheprovider "$@" || status=1
cat "$scratch"/report.* 2>/dev/null && status=1 # of ThreadSanitizer; the others end the process
exit "$status"
