#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Every test that docs/safety.md names exists, and scripts/check-safety notices when one does not.
set -euo pipefail
check=$SERVOSCOPE_SOURCE/scripts/check-safety
"$check"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder"/{docs,tests/unit,tests/cli,tests/fault}
printf 'RUN_TEST(test_limit);\n' >"$folder/tests/unit/test_a.c"
printf '("clip", A, "x", "y"),\n' >"$folder/tests/fault/mutants.py"
: >"$folder/tests/cli/b.sh"

good='**S1** Holds: `tests/unit/test_a.c:test_limit`, `mutant clip`.

**S2** Holds: `tests/cli/b.sh`.'
says() { # says EXPECTED PAGE: the page is refused for this reason
    printf '%s\n' "$2" >"$folder/docs/safety.md"
    if "$check" --root "$folder" >"$folder/out"; then
        echo "not noticed: $1" >&2
        exit 1
    fi
    grep -qF -- "$1" "$folder/out" || {
        echo "expected '$1', got: $(cat "$folder/out")" >&2
        exit 1
    }
}
printf '%s\n' "$good" >"$folder/docs/safety.md"
"$check" --root "$folder"
says 'does not run test_other' "${good/test_limit/test_other}"
says 'tests/unit/test_c.c: is not there' "${good/test_a.c/test_c.c}"
says 'tests/cli/c.sh: is not there' "${good/b.sh/c.sh}"
says 'mutant cut: not in' "${good/clip/cut}"
says 'expected S2' "${good/S2/S3}"
says 'S2: names no test' "${good/\`tests\/cli\/b.sh\`/nothing}"
says 'holds no invariant' 'nothing here'
