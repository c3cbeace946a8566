#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks what every source file must have: an SPDX line, clang-format's layout, no path of somebody's machine.

Prints one line a violation; exit 1 where there is one.
"""
import argparse
import pathlib
import re
import subprocess
import sys

SPDX = "SPDX-License-Identifier: Apache-2.0"
SOURCES = {".h", ".cpp", ".c", ".idl", ".cmake", ".py", ".sh", ".ts", ".js", ".mjs", ".css"}
CPP = {".h", ".cpp", ".c"}
SKIPPED = re.compile(r"(^|/)(\.git|build|node_modules|dist)(/|$)")
# An absolute path below a home or a work folder; not the tail of a longer path or of an address.
MACHINE_PATH = re.compile(r"(?<![\w.~*$}/-])/(?:work|root|home/\w+|Users/\w+)/\w")


def files_of(root):
    """Files git tracks or would add; all files where there is no git."""
    try:
        out = subprocess.run(["git", "-c", f"safe.directory={root}", "-C", root, "ls-files", "-z", "--cached",
                              "--others", "--exclude-standard"], capture_output=True, check=True).stdout
        paths = [root / p for p in out.decode().split("\0") if p]
    except (OSError, subprocess.CalledProcessError):
        paths = list(root.rglob("*"))
    return sorted(p for p in paths if p.is_file() and not SKIPPED.search(p.relative_to(root).as_posix()))


def is_source(path, lines):
    return path.suffix in SOURCES or path.name == "CMakeLists.txt" or bool(lines and lines[0].startswith("#!"))


def violations_in(name, path, text):
    lines = text.splitlines()
    if is_source(path, lines):
        line = lines[1:2] if lines and lines[0].startswith("#!") else lines[:1]
        if not line or SPDX not in line[0]:
            yield f"{name}:1: begin with `{SPDX}`"
    for number, line in enumerate(lines, 1):
        match = MACHINE_PATH.search(line)
        if match:
            yield f"{name}:{number}: a path of one machine: {line[match.start():][:40]}"


def format_violations(root, paths):
    if not paths:
        return []
    result = subprocess.run(["clang-format", "--dry-run", "--ferror-limit=3", *map(str, paths)], cwd=root,
                            capture_output=True, text=True)
    return sorted({f"{line.split(': warning')[0]}: run clang-format -i"
                   for line in result.stderr.splitlines() if "clang-format-violations" in line})


def check(root):
    found, cpp = [], []
    for path in files_of(root):
        name = path.relative_to(root).as_posix()
        try:
            text = path.read_text()
        except UnicodeDecodeError:
            continue
        found.extend(violations_in(name, path, text))
        if path.suffix in CPP:
            cpp.append(name)
    return found + format_violations(root, cpp)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("root", nargs="?", default=pathlib.Path(__file__).resolve().parent.parent, type=pathlib.Path)
    found = check(parser.parse_args().root)
    print("\n".join(found) or "style: ok")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
