#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# What the program says of itself: help, manual pages and completions tell of the same options, and those are the ones it takes.
subcommand=completion
source "$SERVOSCOPE_SOURCE/tests/support/cli.sh"

refuse 2 "expected bash, zsh or fish" tcsh
refuse 2 "missing" # no shell
refuse 2 "--json" bash --json
subcommand=manual
refuse 2 "'nothing' is not a subcommand" nothing
subcommand=doctor
refuse 2 "unexpected 'x'" x

"$SERVOSCOPE" completion bash >completion.bash
complete_words() { # complete_words WORD...: what bash offers for the last one
    COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
    _servoscope
    printf '%s\n' "${COMPREPLY[@]}"
}
source completion.bash
[ "$(complete_words servoscope diag)" = diagnose ] || fail "diag: $(complete_words servoscope diag)"
[ "$(complete_words servoscope frf --meth)" = --method ] || fail "frf --meth"
[ "$(complete_words servoscope manual tu)" = tune ] || fail "manual tu"
[ "$(complete_words servoscope help frf)" = frf ] || fail "help frf"
[ "$(complete_words servoscope completion z)" = zsh ] || fail "completion z"
[[ $(complete_words servoscope design --lim) == *--limit-velocity-m-per-s* ]] || fail "design --lim"

# Every offered option is one that the subcommand takes: a refusal speaks of its value, or of what is missing.
mapfile -t names < <(complete_words servoscope '' | grep -vx -e '--.*' -e help)
[ "${#names[@]}" -ge 11 ] || fail "only ${#names[@]} subcommands"
for name in "${names[@]}"; do
    "$SERVOSCOPE" "$name" --help >help
    read -r summary <help
    [[ $summary == "servoscope $name: "* ]] || fail "help of $name begins with: $summary"
    grep -q '^example' help || fail "help of $name has no example"
    awk 'length > 132 { print; bad = 1 } END { exit bad }' help || fail "help of $name is too wide"
    while read -r option; do
        case $option in --json | --quiet | --help) continue ;; esac
        "$SERVOSCOPE" "$name" "$option" </dev/null >/dev/null 2>err || true
        grep -q 'unknown option' err && fail "$name does not take $option"
    done < <(complete_words servoscope "$name" --)
done

# And every option of a subcommand's table is offered somewhere.
for name in "${names[@]}"; do complete_words servoscope "$name" --; done | sort -u >offered
grep -rhoE '\{\.name = "[a-z0-9-]+", \.kind = option_' "$SERVOSCOPE_SOURCE/tools/servoscope" | cut -d'"' -f2 | sort -u >taken
[ "$(wc -l <taken)" -gt 50 ] || fail "only $(wc -l <taken) options found in the sources"
while read -r option; do
    grep -qx -- "--$option" offered || fail "no help names --$option"
done <taken
for name in "${names[@]}"; do
    complete_words servoscope "$name" -- >offered
    while read -r option; do
        "$SERVOSCOPE" "$name" "--$option=" >/dev/null 2>err || true
        grep -q "unknown option" err || grep -qx -- "--$option" offered || fail "$name takes --$option, and its help does not name it"
    done <taken
done

# The other shells' scripts offer the same.
for name in "${names[@]}"; do
    complete_words servoscope "$name" -- | sort -u >offered
    "$SERVOSCOPE" completion zsh | sed -n "s/^    $name) compadd -- \(.*\) ;;$/\1/p" | tr ' ' '\n' | sort -u | cmp - offered || fail "zsh: $name"
    "$SERVOSCOPE" completion fish | sed -n "s/.*__fish_seen_subcommand_from $name' -l \([^ ]*\).*/--\1/p" | sort -u | cmp - offered ||
        fail "fish: $name"
done

# A word that is misspelt is answered with the one that was meant, if there is one.
meant() { # meant PART WORD...
    local part=$1 status=0
    shift
    "$SERVOSCOPE" "$@" >out 2>err || status=$?
    [ "$status" -eq 2 ] || fail "status $status: $*"
    grep -qF -- "$part" err || fail "no '$part' in '$(cat err)': $*"
    [ ! -s out ] || fail "says something on standard output: $*"
}
meant "'diagnos' is not a subcommand: did you mean diagnose?" diagnos
meant "did you mean simulate?" simualte
meant "did you mean measure?" meas
meant "'xyzzy' is not a subcommand; 'servoscope --help' lists them" xyzzy
meant "did you mean frf?" manual ffr
meant "unknown option '--methd': did you mean --method?" frf run.csv --methd mean
meant "unknown option '--limit-vel=3'; see" design --limit-vel=3 # four options begin with that
meant "did you mean --amplitude-tolerance?" design --amplitude-tolerence 1
meant "unknown option '-out': did you mean --out?" frf run.csv -out x.csv
meant "did you mean --quiet?" frf --quite
meant "unknown option '--zzz'; see 'servoscope frf --help'" frf --zzz
"$SERVOSCOPE" help frf >one && "$SERVOSCOPE" frf --help | cmp - one || fail "help frf"
"$SERVOSCOPE" help | cmp - <("$SERVOSCOPE" --help) || fail "help"

# Manual pages: requests are those of man(7), and each subcommand is on the program's page.
"$SERVOSCOPE" manual >servoscope.1
for name in "${names[@]}"; do
    "$SERVOSCOPE" manual "$name" >page.1 || fail "no manual page of $name"
    for section in NAME SYNOPSIS EXAMPLES 'EXIT STATUS'; do
        grep -qx "\.SH $section" page.1 || fail "manual page of $name: no $section"
    done
    awk '/^\.SH SYNOPSIS/ { inside = 1; next } /^\.SH/ { inside = 0 } inside && /^servoscope / { print }' page.1 >synopsis
    [ "$(wc -l <synopsis)" -eq "$("$SERVOSCOPE" "$name" --help | grep -cE '^(usage:|      ) servoscope ')" ] || fail "synopsis of $name: $(cat synopsis)"
    grep -q "servoscope\\\\*-$name" servoscope.1 || fail "$name is not on the program's page"
    cat page.1
done | grep '^[.]' | grep -vE '^\.(TH|SH|TP|B|BR|I|nf|fi)( |$)' && fail "the line above is no request of a manual page"

# The doctor finds the clock, whatever machine this is, and speaks JSON.
"$SERVOSCOPE" doctor --json >doctor.json || fail "doctor: status $?"
python3 - <<'PYTHON' || fail "doctor.json: $(cat doctor.json)"
import json
checks = {check["id"]: check for check in json.load(open("doctor.json"))["checks"]}
assert {"program", "can_kernel", "can_interfaces", "serial", "clock", "priority", "memory_lock"} <= set(checks)
for check in checks.values():
    assert check["state"] in ("good", "limited", "missing") and check["says"]
    assert check["state"] != "missing" or check["id"] == "serial" or check["remedy"], check
PYTHON
[ "$failures" -eq 0 ]
