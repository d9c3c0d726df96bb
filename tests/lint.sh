#!/usr/bin/env bash
# The linters side by side, in the environment whose bin folder has this Python, .venv/bin/python by default:
#   lint.sh [PYTHON]
# The status is 1 if one finds something.
set -uo pipefail
cd "$(dirname "$0")/.."
bin=$(dirname "${1:-.venv/bin/python}")
waiting=()
"$bin/ruff" check . & waiting+=($!)
"$bin/ruff" format --check . & waiting+=($!)
"$bin/mypy" & waiting+=($!)
find fmu_src harness/engine harness/masters benchmarks -name '*.[ch]' -exec "$bin/clang-format" --dry-run --Werror {} + & waiting+=($!)
failed=0
for each in "${waiting[@]}"; do
    wait "$each" || failed=1
done
exit "$failed"
