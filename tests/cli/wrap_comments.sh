#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# scripts/wrap-comments breaks what is too long, joins nothing to a table or an equation, and has nothing to do a second time.
set -euo pipefail
wrap=$SERVOSCOPE_SOURCE/scripts/wrap-comments
long='one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen seventeen eight nine'
{
    printf '/// %s and\n/// the rest.\n' "$long"
    printf '/// Equation:  %s\n/// Shapes:    as they are\n' "$long"
    printf '/* %s and. */\n' "$long"
    printf 'int x; // %s\n' "$long"
} >text.c
cp text.c once.c
"$wrap" once.c
cat >expected.c <<END
/// ${long% nine}
/// nine and the rest.
/// Equation:  ${long% seventeen eight nine}
///            seventeen eight nine
/// Shapes:    as they are
/* $long
 * and. */
int x; // $long
END
diff expected.c once.c
"$wrap" once.c
diff expected.c once.c
