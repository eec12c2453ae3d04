# SPDX-License-Identifier: MIT
# Clients of others for tests: source it.

# python_with NAME MODULES PACKAGE...   sets `venv` to a virtual environment beside the build that has the modules (separated by
# commas); made when it is first wanted, by one test at a time. Where no package index can be reached the test is skipped.
python_with() {
    venv=$(dirname "$SERVOSCOPE")/venv-$1
    local modules=$2 made=0
    shift 2
    exec 9>"$venv.lock"
    flock 9
    "$venv/bin/python" -c "import $modules" 2>/dev/null ||
        { python3 -m venv "$venv" && "$venv/bin/pip" --quiet install "$@"; } >&2 || made=$?
    exec 9>&-
    [ "$made" -eq 0 ] || {
        echo "skipped: no package index"
        exit 77
    }
}
