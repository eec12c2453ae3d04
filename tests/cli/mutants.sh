#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Every safety check of lib/guard and of the simulated drive, taken out one at a time, is missed by a test.
set -euo pipefail
exec python3 "$SERVOSCOPE_SOURCE/tests/fault/mutants.py" "$UNITY_ROOT"
