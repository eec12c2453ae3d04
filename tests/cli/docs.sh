#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The commands in the documentation run as printed, its C compiles, and what a page says of a result is what comes out.
set -euo pipefail
# Whole stories, with diagnoses: minutes under sanitizers.
export SERVOSCOPE=${SERVOSCOPE_OPTIMISED:-$SERVOSCOPE}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
docs=$SERVOSCOPE_SOURCE/docs
failures=0

fail() {
    echo "FAILED: $*" >&2
    failures=$((failures + 1))
}

pages=("$docs/quick-start.md" "$docs"/guides/*.md)
ran=0
for page in "${pages[@]}"; do
    name=$(basename "$page" .md)
    mkdir "$folder/$name"
    "$SERVOSCOPE_SOURCE/scripts/page-commands" "$page" >"$folder/$name/commands"
    [ -s "$folder/$name/commands" ] || continue
    ran=$((ran + 1))
    (cd "$folder/$name" && "$SERVOSCOPE_SOURCE/scripts/page-commands" "$page" --run >said 2>&1) || {
        cat "$folder/$name/said" >&2
        fail "the commands of $page"
    }
done
[ "$ran" -ge 4 ] || fail "only $ran pages have commands"
grep -q '^Explained: cogging' "$folder/quick-start/said" || fail "quick start: no cogging"
grep -q '^Explained: coulomb friction' "$folder/commission-an-axis/said" || fail "commissioning: no friction"
grep -q '^Explained: load bias' "$folder/your-own-data/said" || fail "own data: no bias"
grep -q '^Explained: torque lag and load bias' "$folder/without-hardware/said" || fail "without hardware: no lag"

# The effect of the guide is a whole file.
awk '/^```$/ { inside = 0 } inside { print } /^```c$/ { inside = 1 }' "$docs/guides/add-a-cause.md" >"$folder/effect.c"
grep -q sim_effect_quadratic_drag "$folder/effect.c" || fail "no effect in the guide"
"${CC:-cc}" -std=c11 -Wall -Wextra -Wpedantic -Wshadow -Werror -fsyntax-only -I "$SERVOSCOPE_SOURCE" "$folder/effect.c" ||
    fail "the effect of the guide"

# Every link between pages leads somewhere.
while IFS=: read -r page link; do
    target=${link#*](}
    target=${target%)}
    target=${target%%#*}
    case $target in '' | http* | reference/*) continue ;; esac
    case $page in */guides/*) case $target in ../reference/*) continue ;; esac ;; esac
    [ -e "$(dirname "$page")/$target" ] || fail "$page: $target is not there"
done < <(grep -roE '\]\([^) ]+\)' --include='*.md' "$docs" "$SERVOSCOPE_SOURCE/README.md" "$SERVOSCOPE_SOURCE/SECURITY.md" "$SERVOSCOPE_SOURCE/CONTRIBUTING.md")
[ "$failures" -eq 0 ]
