#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Every line and every branch of lib/ is taken by its own tests.
set -euo pipefail
exec "$SERVOSCOPE_SOURCE/scripts/lib-coverage"
