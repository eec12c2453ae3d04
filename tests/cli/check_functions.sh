#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# scripts/check-functions counts lines and branches as it says, and fails beyond its limits.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
check=$SERVOSCOPE_SOURCE/scripts/check-functions

cat >"$folder/small.c" <<'END'
struct pair { int a, b; };
static const struct pair table[] = {{1, 2}, {3, 4}};
/* if (comments) { count } */
int small(int x)
{
    const char *text = "if (x) { while (y) }";
    if (x && table[0].a) {
        return text[0] ? 1 : 2;
    }
    return 0;
}
END
"$check" "$folder/small.c" >"$folder/out"
grep -q ' 8 lines, complexity   4 .*: small' "$folder/out" || {
    cat "$folder/out" >&2
    exit 1
}

{
    printf 'int long_one(int x)\n{\n'
    for _ in $(seq 80); do printf '    x++;\n'; done
    printf '    return x;\n}\n'
} >"$folder/long.c"
{
    printf 'int branched(int x)\n{\n'
    for i in $(seq 15); do printf '    if (x == %d) x++;\n' "$i"; done
    printf '    return x;\n}\n'
} >"$folder/branched.c"
for name in long branched; do
    if "$check" "$folder/$name.c" >"$folder/out"; then
        echo "not caught: $name.c" >&2
        exit 1
    fi
done
grep -q 'branched: 19 lines, complexity 16; expected' "$folder/out" || {
    cat "$folder/out" >&2
    exit 1
}
