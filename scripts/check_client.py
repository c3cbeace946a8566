#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""check_client.py PROGRAM LIBRARY: the program holds none of the functions that the static library defines."""
import subprocess
import sys


def functions(file):
    """Strong functions defined in `file`: inline ones may be anybody's."""
    out = subprocess.run(["nm", "--defined-only", file], capture_output=True, text=True, check=True).stdout
    rows = (line.split() for line in out.splitlines())
    return {row[2] for row in rows if len(row) == 3 and row[1] == "T"}


def main():
    program, library = map(functions, sys.argv[1:3])
    if not program or not library:
        print("no functions found: is one of the files stripped?")
        return 1
    shared = sorted(program & library)
    for name in shared[:10]:
        print(f"{sys.argv[1]} holds {name} of {sys.argv[2]}")
    print(f"{len(shared)} of {len(library)} functions shared")
    return 1 if shared else 0


if __name__ == "__main__":
    sys.exit(main())
