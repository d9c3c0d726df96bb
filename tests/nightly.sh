#!/usr/bin/env bash
# The long tests: all blocks compiled at every level of optimisation, all blocks under every sanitizer, fuzzing for ten
# minutes each way, the tests with sanitized code, 220 random systems as composites, 500 random systems against
# references that are not from the library, 300 random log files, 100 million steps and 100 000 instances on end,
# mutants of input files, 200 mutants of the C code, of which README's test command must find 95 %, and all tests, with
# all odd values of system files, with three kernels of OpenBLAS (SkylakeX needs a processor with AVX-512).
#   nightly.sh [SECONDS] [MUTANTS]     seconds for each way of fuzzing, 600 by default, and mutants of each kind of
#                                      input file, 2000 by default; those that fail are kept in ./mutants
# What fails is shown; the status is 1 then. Needs what tests/debian-packages.sh installs.
set -uo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-600}
mutants=${2:-2000}
python=${PYTHON:-python3}
failed=0
step() {
    echo "== $*"
    "$@" || failed=1
}
step tests/lint.sh "$(command -v "$python")"
step "$python" tests/slow/fuzzing/native_checks.py warnings
step "$python" tests/slow/fuzzing/native_checks.py threads
step "$python" tests/slow/fuzzing/native_checks.py fuzz "$((2 * seconds))"
step "$python" tests/slow/fuzzing/call_machine.py "$seconds"
step env THOROUGH=1 tests/slow/sanitized.sh address
step env THOROUGH=1 tests/slow/sanitized.sh thread
step env THOROUGH=1 RANDOM_SYSTEMS=220 "$python" -m pytest -q tests/slow/test_composites.py -k random
step env THOROUGH=1 EXCHANGE_MOTIONS=100 "$python" -m pytest -q -n 2 tests/slow/test_exchange_motions.py
step "$python" tests/robustness/coupling_search.py 500
step "$python" tests/slow/log_variants.py 300
step "$python" tests/slow/axes_of_the_study.py --out "$(mktemp -d)"
step "$python" tests/slow/axes_under_load.py
step "$python" tests/slow/servo_pendulum.py
step "$python" tests/slow/soak.py
step "$python" tests/slow/mutation_check.py
step "$python" tests/slow/fuzzing/mutants.py "$mutants"
for kernel in Prescott Haswell SkylakeX; do
    step env OPENBLAS_CORETYPE="$kernel" THOROUGH=1 "$python" -m pytest -q -n 2
    step env OPENBLAS_CORETYPE="$kernel" ALL_ODD_VALUES=1 THOROUGH=1 "$python" -m pytest -q -n 2 tests/slow
done
exit "$failed"
