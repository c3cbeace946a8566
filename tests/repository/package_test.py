#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The Debian packages of a build: makes them, unpacks them as dpkg would, and runs what is in them.

usage: package_test.py BUILD_FOLDER
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

build = Path(sys.argv.pop())


def output(*command, **more):
    return subprocess.run(command, check=True, capture_output=True, text=True, **more).stdout


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        made = Path(cls.folder.name) / 'made'
        subprocess.run(['cpack', '-G', 'DEB', '-B', made], cwd=build, check=True, capture_output=True)
        cls.packages = {output('dpkg-deb', '-f', file, 'Package').strip(): file for file in made.glob('*.deb')}
        cls.root = Path(cls.folder.name) / 'root'
        for file in cls.packages.values():
            subprocess.run(['dpkg-deb', '-x', file, cls.root], check=True)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_the_server_brings_the_client_and_neither_more_than_debian_has(self):
        self.assertEqual(set(self.packages), {'relievo', 'relievo-server'})
        depends = output('dpkg-deb', '-f', self.packages['relievo-server'], 'Depends')
        self.assertIn('relievo (=', depends)
        self.assertNotIn('opencv', output('dpkg-deb', '-f', self.packages['relievo'], 'Depends'))

    def test_everything_lies_where_debian_wants_it(self):
        files = {str(path.relative_to(self.root)) for path in self.root.rglob('*') if path.is_file()}
        self.assertLessEqual({'usr/bin/relievo', 'usr/bin/relievo-server', 'etc/relievo/server.toml',
                              'usr/lib/systemd/system/relievo-server.service',
                              'usr/lib/systemd/system/relievo-web.service', 'usr/lib/sysusers.d/relievo.conf',
                              'usr/lib/sysctl.d/60-relievo.conf', 'usr/share/doc/relievo/docs/OPERATION.md',
                              'usr/share/doc/relievo/codec/FORMAT.md', 'usr/share/doc/relievo/idl/relievo.idl'},
                             files)
        self.assertEqual([f for f in files if not re.match('usr/(bin|lib|share)/|etc/relievo/', f)], [])
        for name in self.packages:
            self.assertIn(f'usr/share/doc/{name}/copyright', files)

    def test_settings_that_a_person_changed_survive_an_upgrade(self):
        control = Path(self.folder.name) / 'control'
        subprocess.run(['dpkg-deb', '-e', self.packages['relievo-server'], control], check=True)
        self.assertEqual((control / 'conffiles').read_text().split(), ['/etc/relievo/server.toml'])

    def test_what_is_installed_by_hand_leaves_settings_alone(self):
        root = Path(self.folder.name) / 'by hand'
        subprocess.run(['cmake', '--install', build, '--prefix', '/opt/relievo'], check=True, capture_output=True,
                       env={**os.environ, 'DESTDIR': str(root)})
        self.assertTrue((root / 'opt/relievo/bin/relievo-server').exists())
        self.assertEqual([path.name for path in root.iterdir()], ['opt'])

    def test_a_service_that_does_not_run_leaves_no_package_half_installed(self):
        folder = Path(self.folder.name)
        programs = folder / 'programs'
        programs.mkdir()
        for name in ('systemctl', 'systemd-sysusers', 'sysctl'):
            # Of a systemd whose services do not come up.
            (programs / name).write_text('#!/bin/sh\n[ "$1" != try-restart ] && [ "$1" != disable ]\n')
            (programs / name).chmod(0o755)
        for name, file in self.packages.items():
            control = folder / f'{name}.control'
            subprocess.run(['dpkg-deb', '-e', file, control], check=True)
            for script, argument in (('postinst', 'configure'), ('prerm', 'remove')):
                # As on a machine that systemd runs.
                text = (control / script).read_text().replace('/run/systemd/system', str(programs))
                done = subprocess.run(['sh', '-c', text, script, argument], capture_output=True, text=True,
                                      env={**os.environ, 'PATH': f'{programs}:{os.environ["PATH"]}'})
                self.assertEqual(done.returncode, 0, f'{name} {script}: {done.stderr}')
                self.assertEqual('journalctl' in done.stderr, script == 'postinst', done.stderr)

    def test_the_programs_run(self):
        for name in self.packages:
            self.assertTrue(output(self.root / 'usr/bin' / name, '--version').startswith(name + ' '))
        served = output(self.root / 'usr/bin/relievo-server', 'serve', '--config',
                        self.root / 'etc/relievo/server.toml', '--web', 'none', '--interface', 'lo', '--keys', 'none',
                        '--domain', os.environ.get('RELIEVO_TEST_DOMAIN', '229'), '--frames', '3', '--fast')
        self.assertIn('stream face', served)

    def test_systemd_takes_the_units(self):
        if shutil.which('systemd-analyze') is None:
            self.skipTest('no systemd-analyze here')
        for unit in (self.root / 'usr/lib/systemd/system').iterdir():
            # With the program where it was unpacked, since verify looks for it.
            here = Path(self.folder.name) / unit.name
            here.write_text(unit.read_text().replace('ExecStart=/usr', f'ExecStart={self.root}/usr'))
            said = subprocess.run(['systemd-analyze', 'verify', '--man=no', here], capture_output=True, text=True)
            self.assertEqual((said.returncode, said.stderr), (0, ''), unit.name)


if __name__ == '__main__':
    unittest.main()
