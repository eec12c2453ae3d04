#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The simulated drive's sheet, its SDO server and our SDO client against python-canopen, over pipes (tests/support/can_pipe.c),
# in a virtual environment beside the build.
set -euo pipefail
build=$(dirname "$SERVOSCOPE")
pipe=$build/tests/support/can_pipe
sheet=$SERVOSCOPE_SOURCE/sim/node/servoscope-drive.eds
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
source "$SERVOSCOPE_SOURCE/tests/support/foreign.sh"
python_with canopen canopen,can canopen==2.4.1 python-can==4.6.1
"$pipe" eds >"$folder/now.eds"
if ! cmp "$sheet" "$folder/now.eds"; then
    echo "FAILED: the sheet in the repository is not what the dictionary says; renew it with: $pipe eds >sim/node/servoscope-drive.eds" >&2
    exit 1
fi
timeout 300 "$venv/bin/python" "$SERVOSCOPE_SOURCE/tests/foreign/canopen_client.py" "$pipe" "$sheet"
