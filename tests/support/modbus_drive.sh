# SPDX-License-Identifier: MIT
# The simulated drive on Modbus for tests that have sourced cli.sh: source it. What it starts ends with the test.
jobs_of_test=()
trap 'kill "${jobs_of_test[@]}" 2>/dev/null || true; rm -rf "$folder"' EXIT

# serve PLACE: starts the drive of model.json there, sets `drive` to its process and `place` to where it listens
serve() {
    : >served
    "$SERVOSCOPE" drive --model model.json --modbus "$1" >served 2>served-err &
    drive=$!
    jobs_of_test+=("$drive")
    for _ in {1..200}; do
        ! grep -q '^simulated drive on Modbus ' served || break
        sleep 0.05
    done
    place=$(sed -n 's/^simulated drive on Modbus \([^ ,]*\),.*/\1/p' served)
    [ -n "$place" ] || fail "the drive does not say where it is: $(cat served served-err)"
}
