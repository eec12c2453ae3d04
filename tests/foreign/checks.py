# SPDX-License-Identifier: MIT
"""Checks that go on after a failure, so that one run tells all of them."""
import sys

failures = []


def check(condition, text):
    if not condition:
        failures.append(text)
        print(f"FAILED: {text}", file=sys.stderr)
