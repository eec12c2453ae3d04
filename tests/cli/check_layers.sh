#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# scripts/check-layers catches what it is there to catch: each mutant of a small good tree has to fail, for the right reason.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
check=$SERVOSCOPE_SOURCE/scripts/check-layers

fresh() { # a good tree
    rm -rf "$folder/tree"
    mkdir -p "$folder"/tree/{lib/core,lib/frf,sim,lab/record,lab/page,lab/numeric,drivers,tests/unit}
    cd "$folder/tree"
    printf '#include <stdint.h>\n' >lib/core/status.h
    printf '#include "core/status.h"\n' >lib/frf/frf.h
    printf '#include "core/status.h"\n' >sim/model.h
    printf '#include "sim/model.h"\n#include "frf/frf.h"\n' >lab/record/run.h
    printf '\n' >lab/page/page.h
    printf '\n' >drivers/drive.h
    printf '#include "unity.h"\n#include "lab/record/run.h"\n' >tests/unit/test_run.c
}

refuses() { # refuses FILE LINE EXPECTED: the tree with LINE added to FILE fails and says EXPECTED
    fresh
    printf '%s\n' "$2" >>"$1"
    if "$check" --root "$folder/tree" >"$folder/out"; then
        printf 'not caught: %s in %s\n' "$2" "$1" >&2
        exit 1
    fi
    grep -qF -- "$3" "$folder/out" || {
        printf 'expected "%s" for %s in %s, got:\n' "$3" "$2" "$1" >&2
        cat "$folder/out" >&2
        exit 1
    }
}

fresh
"$check" --root "$folder/tree"
refuses lib/core/status.h '#include "sim/model.h"' 'lib/core may not include sim'
refuses lib/core/status.h '#include "frf/frf.h"' 'lib/core may not include lib/frf'
refuses sim/model.h '#include "lab/record/run.h"' 'sim may not include lab/record'
refuses lab/page/page.h '#include "lab/record/run.h"' 'lab/page may not include lab/record'
refuses drivers/drive.h '#include "sim/model.h"' 'drivers may not include sim'
refuses lab/record/run.h '#include "lab/record/run.h"' 'circle: lab/record/run.h'
refuses lab/record/run.h '#include "lib/core/status.h"' 'expected "core/status.h"'
refuses lab/record/run.h '#include "model.h"' 'no such file'
refuses lib/frf/frf.h '#include <stdlib.h>' 'freestanding'
refuses sim/model.h '#include <time.h>' 'no clock'
refuses lab/record/run.h '#include "tests/unit/test_run.c"' 'lab/record may not include tests/unit'
mkdir -p "$folder/tree/lab/cellar" && printf '\n' >"$folder/tree/lab/cellar/new.h"
if "$check" --root "$folder/tree" >"$folder/out"; then
    echo "not caught: a room that is not in the list" >&2
    exit 1
fi
# And the real tree is good.
"$check"
