#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks #include lines against the folder table of docs/ARCHITECTURE.md.

A folder's files may include their own folder, the folders its row names, and std; third-party headers only in
.cpp files (Eigen's fixed-size types excepted), and in base nowhere. Prints one line a violation; exit 1 where
there is one.
"""
import argparse
import pathlib
import re
import sys

STD = set("""
algorithm any array atomic barrier bit bitset cassert cctype cerrno cfenv cfloat charconv chrono cinttypes climits
clocale cmath codecvt compare complex concepts condition_variable coroutine csetjmp csignal cstdarg cstddef cstdint
cstdio cstdlib cstring ctime cuchar cwchar cwctype deque exception execution filesystem format forward_list fstream
functional future initializer_list iomanip ios iosfwd iostream istream iterator latch limits list locale map memory
memory_resource mutex new numbers numeric optional ostream queue random ranges ratio regex scoped_allocator
semaphore set shared_mutex source_location span sstream stack stdexcept stop_token streambuf string string_view
syncstream system_error thread tuple type_traits typeindex typeinfo unordered_map unordered_set utility valarray
variant vector version
""".split())
SYSTEM = re.compile(r"^(sys|netinet|arpa|linux|net)/|^(unistd|fcntl|signal|poll|pthread|sched|dlfcn|errno|spawn|"
                    r"termios|time|netdb|ifaddrs|immintrin|emmintrin|x86intrin|malloc)\.h$")
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


def read_table(text):
    """Rows `| folder | may include | ...` under the table's head, as {folder: set of folders}."""
    rules = {}
    in_table = False
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if cells[:2] == ["folder", "may include"]:
            in_table = True
        elif in_table and not line.startswith("|"):
            break
        elif in_table and not set(cells[0]) <= set("-: "):
            names = re.split(r"[,;]", cells[1])
            rules[cells[0]] = {n.strip() for n in names if n.strip() and not n.strip().startswith("never ")}
    return rules


def folder_of(path, rules):
    """The row, of the longest name, that the path lies in."""
    inside = [f for f in rules if path == f or path.startswith(f + "/")]
    return max(inside, key=len, default=None)


def violations_in(path, text, rules):
    """Lines `path:line: what` for one file, whose path is relative to the root."""
    folder = folder_of(path, rules)
    is_header = path.endswith(".h")
    for number, line in enumerate(text.splitlines(), 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        angle, target = match.group(1) == "<", match.group(2)
        where = f"{path}:{number}: "
        if angle:
            if target in STD or SYSTEM.match(target):
                continue
            if folder == "base":
                yield where + f"base may include std only, not <{target}>"
            elif is_header and not target.startswith("Eigen/"):
                yield where + f"<{target}> is third-party: include it in a .cpp only"
            continue
        target_folder = folder_of(target, rules)
        if target_folder is None:
            if is_header:
                yield where + f'"{target}" is in none of the folders of the table: write the path from the root'
        elif target_folder != folder and target_folder not in rules[folder]:
            yield where + f"{folder} may not include {target_folder} (\"{target}\")"


def check(root):
    rules = read_table((root / "docs/ARCHITECTURE.md").read_text())
    if "base" not in rules:
        return ["docs/ARCHITECTURE.md: the table `| folder | may include |` is missing"]
    found = [f"docs/ARCHITECTURE.md: the table has no row for {name}, which {folder} may include"
             for folder, names in rules.items() for name in sorted(names - set(rules) - {"std"})]
    for folder in rules:
        for file in sorted((root / folder).rglob("*")):
            path = file.relative_to(root).as_posix()
            if file.suffix in (".h", ".cpp", ".c") and "node_modules" not in path and \
                    folder_of(path, rules) == folder:
                found.extend(violations_in(path, file.read_text(), rules))
    # Every folder of C++ that is no test is in the table.
    for file in sorted(root.glob("[a-z]*/**/*.cpp")):
        path = file.relative_to(root).as_posix()
        if not re.match(r"(build|tests|node_modules)/|.*/node_modules/", path) and not folder_of(path, rules):
            found.append(f"{path}: its folder has no row in docs/ARCHITECTURE.md's table")
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("root", nargs="?", default=pathlib.Path(__file__).resolve().parent.parent, type=pathlib.Path)
    found = check(parser.parse_args().root)
    print("\n".join(found) or "includes: ok")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
