#!/usr/bin/env bash
# The long tests: all blocks compiled at every level of optimisation, all blocks under every sanitizer, fuzzing for ten
# minutes each way, the tests with sanitized code, and 100 million steps and 100 000 instances on end.
#   nightly.sh [SECONDS]     seconds for each way of fuzzing, 600 by default
# What fails is shown; the status is 1 then. Needs what tests/debian-packages.sh installs.
set -uo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-600}
python=${PYTHON:-python3}
failed=0
step() {
    echo "== $*"
    "$@" || failed=1
}
step "$python" tests/robustness/native_checks.py warnings
step "$python" tests/robustness/native_checks.py threads
step "$python" tests/robustness/native_checks.py fuzz "$((2 * seconds))"
step "$python" tests/robustness/call_machine.py "$seconds"
step tests/robustness/sanitized.sh address
step tests/robustness/sanitized.sh thread
step "$python" tests/robustness/soak.py
exit "$failed"
