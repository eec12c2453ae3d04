#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# The commands in the documentation run as printed, its C compiles, and what a page says of a result is what comes out.
set -euo pipefail
# Whole stories, with diagnoses: minutes under sanitizers.
export SERVOSCOPE=${SERVOSCOPE_OPTIMISED:-$SERVOSCOPE}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
docs=$SERVOSCOPE_SOURCE/docs
failures=0

fail() {
    echo "FAILED: $*" >&2
    failures=$((failures + 1))
}

listing() { # listing PAGE: its ```c block
    awk '/^```$/ { inside = 0 } inside { print } /^```c$/ { inside = 1 }' "$1"
}

# The effect and the make of drives that the pages add: compiled, and linked with the program as it is, in place of the build's lists.
teach() { # teach BUILD PROGRAM
    local generated=$1/generated link
    listing "$docs/guides/add-a-cause.md" >"$folder/effect.c"
    listing "$docs/bus.md" >"$folder/profile.c"
    sed 's/^const struct sim_effect \*const/extern const struct sim_effect sim_effect_quadratic_drag;\n&/; s/^    NULL,/    \&sim_effect_quadratic_drag,\n&/' \
        "$generated/effects.c" >"$folder/effects.c"
    sed 's/^const struct cia402_profile \*const/extern const struct cia402_profile cia402_profile_acme_one;\n&/; s/^    NULL,/    \&cia402_profile_acme_one,\n&/' \
        "$generated/profiles.c" >"$folder/profiles.c"
    for file in effect effects profile profiles; do
        "${CC:-cc}" -std=c11 -Wall -Wextra -Wpedantic -Wshadow -Werror -I "$SERVOSCOPE_SOURCE" -I "$SERVOSCOPE_SOURCE/lib" \
            -c "$folder/$file.c" -o "$folder/$file.o" || return 1
    done
    link=$(ninja -C "$1" -t commands servoscope | tail -n 1)
    (cd "$1" && eval "${link/ -o servoscope / -o $2 $folder/effect.o $folder/effects.o $folder/profile.o $folder/profiles.o }")
}
mkdir "$folder/taught"
teach "$(dirname "$SERVOSCOPE")" "$folder/taught/servoscope" || fail "the program with the pages' effect and make"

pages=("$docs/quick-start.md" "$docs"/guides/*.md)
ran=0
for page in "${pages[@]}"; do
    name=$(basename "$page" .md)
    mkdir "$folder/$name"
    "$SERVOSCOPE_SOURCE/scripts/page-commands" "$page" >"$folder/$name/commands"
    [ -s "$folder/$name/commands" ] || continue
    ran=$((ran + 1))
    program=$SERVOSCOPE
    case $name in
    add-a-cause) program=$folder/taught/servoscope ;;
    firmware)
        listing "$page" >"$folder/$name/drive.c"
        "$SERVOSCOPE_SOURCE/scripts/amalgamate" --output "$folder/$name" msgen frf guard >/dev/null
        ;;
    esac
    (cd "$folder/$name" && SERVOSCOPE=$program "$SERVOSCOPE_SOURCE/scripts/page-commands" "$page" --run >said 2>&1) || {
        cat "$folder/$name/said" >&2
        fail "the commands of $page"
    }
done
[ "$ran" -ge 6 ] || fail "only $ran pages have commands"
grep -q '^Explained: cogging' "$folder/quick-start/said" || fail "quick start: no cogging"
grep -q '^Explained: coulomb friction' "$folder/commission-an-axis/said" || fail "commissioning: no friction"
grep -q '^Explained: load bias' "$folder/your-own-data/said" || fail "own data: no bias"
grep -q '^Explained: torque lag and load bias' "$folder/without-hardware/said" || fail "without hardware: no lag"

grep -q '^Explained: quadratic drag' "$folder/add-a-cause/said" || fail "add a cause: it is not found"
awk -F, 'NR == 2 { near = $1 == 10 && $2 > 26.8 && $2 < 26.9 } NR > 1 { valid += $4 } END { exit !(near && valid == 40) }' \
    "$folder/firmware/response.csv" || fail "firmware: another response than the page says"
said=$("$folder/taught/servoscope" measure --drive 'can:none?profile=unknown' --table "$folder/quick-start/excitation.mst" \
    --periods 1 --out "$folder/none.csv" 2>&1) && fail "a make that there is not is accepted"
grep -q 'expected one of .*acme_one' <<<"$said" || fail "the make of the page is not among the known ones: $said"

# Every subcommand, option, verb, benchmark and test that a page names is there.
python3 - "$SERVOSCOPE_SOURCE" "$SERVOSCOPE" <<'END' || fail "names in the pages"
import glob
import os
import re
import subprocess
import sys

source, program = sys.argv[1:]


def say(*arguments):
    return subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout


def stems(pattern, cut=0):
    return [os.path.basename(path)[cut:].rsplit(".", 1)[0] for path in glob.glob(os.path.join(source, pattern))]


helps = {name: say(name, "--help") for name in re.findall(r"^  ([a-z]+) ", say("--help"), re.M)}
with open(os.path.join(source, "run"), encoding="utf-8") as file:
    verbs = re.search(r"^build \|.*\)", file.read(), re.M).group(0).rstrip(")").split(" | ")
benches = [path.removesuffix(".sh") for path in os.listdir(os.path.join(source, "bench"))
           if os.access(os.path.join(source, "bench", path), os.X_OK)] + ["NAME"]
tests = ["hidden_effects"] + [f"{folder}/{stem}" for folder in ("unit", "api", "fault", "golden")
                              for stem in stems(f"tests/{folder}/test_*.c", len("test_"))]
tests += [f"{folder}/{stem}" for folder in ("cli", "golden") for stem in stems(f"tests/{folder}/*.sh")]
wrong, checked = [], 0
pages = [os.path.join(source, name) for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")]
for page in pages + glob.glob(os.path.join(source, "docs", "**", "*.md"), recursive=True):
    with open(page, encoding="utf-8") as file:
        text = file.read()
    blocks = re.findall(r"^ *```\w*\n(.*?)^ *```", text, re.M | re.S)
    blocks += re.findall(r"`([^`\n]+)`", re.sub(r"^ *```.*?^ *```", "", text, flags=re.M | re.S))
    for line in "\n".join(blocks).replace("\\\n", " ").split("\n"):
        for name, rest in re.findall(r"\bservoscope ([a-z]+)\b((?:(?! and )[^|;#()])*)", line):
            options = re.findall(r"(?<![\w-])--[a-z][a-z0-9-]*", rest)
            known = helps.get(name, "") + "--help --json --quiet"
            wrong += [f"{page}: servoscope {name} {option}" for option in options if option not in known]
            wrong += [] if name in helps else [f"{page}: servoscope {name}"]
            checked += 1 + len(options)
        for verb, name in re.findall(r"\./run ([a-z]+)(?: ([\w-]+))?", line):
            if verb not in verbs or (verb == "bench" and name and name not in benches):
                wrong.append(f"{page}: ./run {verb} {name}")
            checked += 1
        for choice in re.findall(r" -R '?([^' ]+)'?", line):
            wrong += [f"{page}: no test is called {part}" for part in choice.split("|")
                      if not any(re.search(part, test) for test in tests)]
            checked += 1
# Every formula has a file that computes it.
with open(os.path.join(source, "docs", "theory.md"), encoding="utf-8") as file:
    theory = file.read()
rows = re.findall(r"^\| (F\d[F\d, ]*) \| (.*) \|$", theory, re.M)
placed = [number for numbers, _ in rows for number in numbers.split(", ")]
wrong += [f"theory.md: {number} is computed nowhere" for number in re.findall(r"^\*\*(F\d+)\b", theory, re.M) if number not in placed]
wrong += [f"theory.md: {path}" for _, paths in rows for path in re.findall(r"`(.*?)`", paths)
          if not os.path.exists(os.path.join(source, path))]
# Every benchmark has its place on the page about them.
with open(os.path.join(source, "docs", "testing.md"), encoding="utf-8") as file:
    told = file.read()
wrong += [f"testing.md: no word of ./run bench {name}" for name in benches if name != "NAME" and f"`{name}`" not in told]
# What the glossary calls a name in C is one.
sources = subprocess.run(["grep", "-rhow", "[a-z][A-Za-z0-9_]*", "--include=*.[ch]", "lib", "drivers", "sim", "lab"], cwd=source,
                         check=True, capture_output=True, text=True).stdout
words = set(sources.split())
with open(os.path.join(source, "docs", "glossary.md"), encoding="utf-8") as file:
    wrong += [f"glossary.md: {name}" for name in re.findall(r"`([a-z]\w*)`", file.read()) if name not in words]
print("\n".join(wrong), file=sys.stderr)
sys.exit(1 if wrong or checked < 200 else 0)
END

# Every link between pages leads somewhere.
while IFS=: read -r page link; do
    target=${link#*](}
    target=${target%)}
    target=${target%%#*}
    case $target in '' | http* | reference/*) continue ;; esac
    case $page in */guides/*) case $target in ../reference/*) continue ;; esac ;; esac
    [ -e "$(dirname "$page")/$target" ] || fail "$page: $target is not there"
done < <(grep -roE '\]\([^) ]+\)' --include='*.md' "$docs" "$SERVOSCOPE_SOURCE/README.md" "$SERVOSCOPE_SOURCE/SECURITY.md" "$SERVOSCOPE_SOURCE/CONTRIBUTING.md")
[ "$failures" -eq 0 ]
