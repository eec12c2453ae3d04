# SPDX-License-Identifier: MIT
"""Pages of the documentation that are made from the program and its headers when the site is built, and formulas as MathML.

A hook of mkdocs (mkdocs.yml). SERVOSCOPE names the program whose --help becomes the reference of the command line.
"""
import glob
import html
import os
import re
import subprocess

from latex2mathml.converter import convert
from mkdocs.structure.files import File

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
MODULES = [("core", "Status, fixed point, CRC, configuration"), ("msgen", "Multisine tables and their player"),
           ("frf", "Spectra at the excited bins, statistics, frequency responses"), ("guard", "Limits around an excitation")]


def say(program, *arguments):
    return subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout


def command_line(program):
    names = re.findall(r"^  ([a-z]+) ", say(program, "--help"), re.M)
    parts = ["# Command line\n\nWhat `servoscope SUBCOMMAND --help` says; the manual pages and the completions of the shells come "
             "from the same texts.\n\n```text\n" + say(program, "--help") + "```\n"]
    parts += [f"## {name}\n\n```text\n{say(program, name, '--help')}```\n" for name in names]
    return "\n".join(parts)


def documented(text):
    """Pairs of documentation block and declaration: `///` lines and the code up to its end."""
    pattern = re.compile(r"((?:^[ \t]*///.*\n)+)((?:.*\n)*?.*[;{}].*\n)", re.M)
    for match in pattern.finditer(text):
        words = "\n".join(re.sub(r"^[ \t]*/// ?", "", line) for line in match.group(1).splitlines())
        code = match.group(2)
        if re.match(r"^(struct|enum|union|typedef|#define)\b", code) and code.rstrip().endswith("{"):
            rest = text[match.end():]
            code += rest[:rest.index("\n}") + rest[rest.index("\n}") + 1:].index("\n") + 2]
        if re.match(r"^[A-Za-z#]", code):
            yield words, code.rstrip()


def declared_name(code):
    struct = re.match(r"^(?:typedef )?(?:struct|enum|union) (\w+)[^;(]*\{", code)
    macro = re.match(r"^#define (\w+)", code)
    function = re.search(r"\b(\w+)\(", code)
    found = struct or macro or function
    return found.group(1) if found else None


def as_text(words):
    """A header's words with their line breaks, which columns of equations need."""
    return f'<p style="white-space: pre-wrap">{html.escape(words)}</p>\n'


def c_api():
    parts = ["# C interface\n\n`lib/`, for firmware: C99, no heap, no operating system. Included as `\"frf/dft.h\"` with `lib/` on the "
             "path. Made from the headers, which say it at the place itself.\n"]
    for module, title in MODULES:
        parts.append(f"## {module}: {title}\n")
        for path in sorted(glob.glob(os.path.join(ROOT, "lib", module, "*.h"))):
            with open(path, encoding="utf-8") as file:
                text = file.read()
            if "not for applications" in text:
                continue
            parts.append(f"### {module}/{os.path.basename(path)}\n")
            head = re.match(r"/\* SPDX.*\*/\n((?:///.*\n)+)", text)
            if head:
                parts.append(as_text(re.sub(r"^/// ?", "", head.group(1), flags=re.M)))
                text = text[head.end():]
            for words, code in documented(text):
                name = declared_name(code)
                code = re.sub(r"\)\s*\{$", ");", code)  # an inline function: what it is called with, not how it works
                parts += [f"#### `{name}`\n", f"```c\n{code}\n```\n", as_text(words)] if name else []
    return "\n".join(parts)


def on_files(files, config):
    program = os.environ.get("SERVOSCOPE", os.path.join(ROOT, "build", "release", "servoscope"))
    for name, content in [("reference/command-line.md", command_line(program)), ("reference/c-api.md", c_api())]:
        files.append(File.generated(config, name, content=content))
    return files


def on_page_content(content, page, config, files):
    """Formulas are set by the browser itself: no script, nothing from elsewhere."""
    def mathml(match):
        block = match.group(1) == "div" or match.group(2).startswith("\\[")
        source = html.unescape(match.group(2))[2:-2]
        return convert(source, display="block" if block else "inline")
    return re.sub(r'<(div|span) class="arithmatex">(.*?)</\1>', mathml, content, flags=re.S)
