#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# scripts/with-vcan: the interfaces are up inside, and status, output and environment come through.
# Where it would have to install something first, that is done in CI and the test is skipped elsewhere.
set -euo pipefail
with_vcan=$SERVOSCOPE_SOURCE/scripts/with-vcan
if [ ! -e /sys/class/net/vcan0 ] && ! command -v linux.uml >/dev/null; then
    [ -n "${CI:-}" ] || exit 77
    "$with_vcan" true
fi

result=0
GREETING='with "quotes"' "$with_vcan" -i "vcan0 vcan1" bash -c '
    for name in vcan0 vcan1; do (( $(</sys/class/net/$name/flags) & 1 )) || exit 4; done
    echo "$GREETING $PWD"; echo error >&2; exit 3' >out 2>err || result=$?
[ "$result" -eq 3 ]
[ "$(cat out)" = "with \"quotes\" $PWD" ]
[ "$(cat err)" = error ]
