#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The checks of scripts/ find what they are for, and nothing in what is right."""
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
sys.dont_write_bytecode = True
import check_includes  # noqa: E402
import check_style  # noqa: E402

TABLE = """text
| folder | may include | what it is |
|---|---|---|
| base | std | words |
| capture | base | decoding |
| web/gateway | base | HTTP |
| client | base, web/gateway; never capture | a program |

after"""
SPDX = "// SPDX-License-Identifier: Apache-2.0\n"


class Includes(unittest.TestCase):
    def setUp(self):
        self.rules = check_includes.read_table(TABLE)

    def violations(self, path, line):
        return list(check_includes.violations_in(path, SPDX + line, self.rules))

    def test_table(self):
        self.assertEqual(self.rules, {"base": {"std"}, "capture": {"base"}, "web/gateway": {"base"},
                                      "client": {"base", "web/gateway"}})

    def test_allowed(self):
        for path, line in [("base/a.h", "#include <vector>"), ("base/a.cpp", "#include <unistd.h>"),
                           ("capture/x/a.h", '#include "base/a.h"'), ("capture/x/a.h", '#include "capture/y/b.h"'),
                           ("capture/a.cpp", "#include <opencv2/core.hpp>"), ("capture/a.h", "#include <Eigen/Core>"),
                           ("client/a.cpp", '#include "web/gateway/gateway.h"'),
                           ("client/a.cpp", '  // #include "capture/x.h"')]:
            self.assertEqual(self.violations(path, line), [], (path, line))

    def test_refused(self):
        for path, line in [("base/a.h", '#include "capture/b.h"'), ("base/a.cpp", "#include <opencv2/core.hpp>"),
                           ("capture/a.h", "#include <opencv2/core.hpp>"), ("client/a.cpp", '#include "capture/b.h"'),
                           ("web/gateway/a.h", '#  include "client/b.h"'), ("capture/a.h", '#include "b.h"')]:
            found = self.violations(path, line)
            self.assertEqual(len(found), 1, (path, line))
            self.assertTrue(found[0].startswith(path + ":2: "), found)

    def test_folder_without_a_row(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "docs").mkdir()
            (root / "docs/ARCHITECTURE.md").write_text(TABLE)
            (root / "extra/deep").mkdir(parents=True)
            (root / "extra/deep/a.cpp").write_text(SPDX)
            self.assertEqual(len(check_includes.check(root)), 1)


class Style(unittest.TestCase):
    def found(self, name, text):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / name).write_text(text)
            return check_style.check(root)

    def test_good(self):
        self.assertEqual(self.found("a.cpp", SPDX + "int x;\n"), [])
        self.assertEqual(self.found("run", "#!/bin/sh\n# SPDX-License-Identifier: Apache-2.0\nls ./work/x\n"), [])
        self.assertEqual(self.found("a.md", "see https://a.example/work/x and $d/root/x\n"), [])

    def test_bad(self):
        self.assertEqual(len(self.found("a.cpp", "int x;\n")), 1)
        self.assertEqual(len(self.found("run", "#!/bin/sh\nls\n")), 1)
        self.assertIn("clang-format", self.found("a.cpp", SPDX + "int   x;\n")[0])
        for folder in ("work", "root", "home/me"):
            self.assertIn("a path of one machine", self.found("a.md", f"see /{folder}/x\n")[0])


if __name__ == "__main__":
    unittest.main()
