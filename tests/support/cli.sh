# SPDX-License-Identifier: MIT
# Start of a test of one subcommand from the command line: source it with `subcommand` set. The test runs in a folder of its own
# that is removed at its end, counts `failures`, and ends by looking at them.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
failures=0

fail() {
    echo "FAILED: $*" >&2
    failures=$((failures + 1))
}

# refuse STATUS PART ARGUMENTS...   the program ends with STATUS, says PART in one line on standard error, writes no x.csv
refuse() {
    local expected=$1 part=$2 status=0
    shift 2
    "$SERVOSCOPE" "$subcommand" "$@" >out 2>err || status=$?
    [ "$status" -eq "$expected" ] || fail "status $status instead of $expected: $*"
    grep -qF -- "$part" err || fail "no '$part' in '$(cat err)': $*"
    [ "$(wc -l <err)" -eq 1 ] || fail "not one line: $(cat err)"
    [ ! -s out ] || fail "standard output is not empty: $*"
    [ ! -e x.csv ] || fail "left behind x.csv: $*"
}
