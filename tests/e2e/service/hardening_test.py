#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The services under the restrictions of their units: what is forbidden fails, and all they do works.

usage: hardening_test.py SERVER CLIENT
"""
import base64
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request

HERE = pathlib.Path(__file__).resolve().parent
UNITS = HERE.parents[2] / 'packaging'
client = pathlib.Path(sys.argv.pop())
server = pathlib.Path(sys.argv.pop())
DOMAIN = ['--domain', os.environ.get('RELIEVO_TEST_DOMAIN', '229'), '--interface', 'lo', '--keys', 'none']
PATIENCE_S = 60
MOST_EXPOSURE = 1.5  # of systemd-analyze security, 0 to 10

# What it may not do, by Python, which is confined alike; prints names of what was forbidden.
FORBIDDEN = r'''
import ctypes, errno, json, mmap, os, socket
def forbidden(do, *expected):
    try:
        do()
    except OSError as refused:
        return refused.errno in expected
    return False
libc = ctypes.CDLL(None, use_errno=True)
def call(name, *arguments):
    if getattr(libc, name)(*arguments) == -1:
        raise OSError(ctypes.get_errno(), name)
def code(protection):
    mmap.mmap(-1, 4096, prot=protection)
print(json.dumps({
    'write to the system': forbidden(lambda: open('/etc/relievo-was-here', 'w'), errno.EROFS, errno.EACCES),
    'write to /usr': forbidden(lambda: open('/usr/relievo-was-here', 'w'), errno.EROFS, errno.EACCES),
    'see homes': forbidden(lambda: os.listdir('/root'), errno.EACCES),
    'be root': forbidden(lambda: os.setuid(0), errno.EPERM),
    'open a port below 1024': forbidden(lambda: socket.socket().bind(('127.0.0.1', 80)), errno.EACCES),
    'see raw packets': forbidden(lambda: socket.socket(socket.AF_PACKET, socket.SOCK_RAW), errno.EPERM, errno.EAFNOSUPPORT),
    'make executable memory': forbidden(lambda: code(mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC), errno.EPERM),
    'make namespaces': forbidden(lambda: call('unshare', 0x10000000), errno.EPERM),
    'mount': forbidden(lambda: call('mount', b'none', b'/tmp', b'tmpfs', 0, None), errno.EPERM),
    'trace others': forbidden(lambda: call('ptrace', 16, 1, 0, 0), errno.EPERM),
    'set the clock': forbidden(lambda: call('settimeofday', b'\0' * 16, None), errno.EPERM),
    'run in real time': forbidden(lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1)), errno.EPERM),
    'set the user of a program': forbidden(lambda: os.chmod('/tmp/state', 0o4755), errno.EPERM),
    'own its files to others': forbidden(lambda: os.chown('/tmp/state', 0, 0), errno.EPERM),
    'open other devices': forbidden(lambda: open('/dev/kmsg'), errno.ENOENT, errno.EPERM),
}))
'''


def why_not():
    if os.geteuid() != 0:
        return 'only root can give privileges up'
    for program in ('systemd-analyze', 'unshare'):
        if shutil.which(program) is None:
            return f'no {program} here'
    if subprocess.run(['unshare', '--mount', 'true'], capture_output=True).returncode != 0:
        return 'no mount namespaces here'
    try:
        import ctypes
        ctypes.CDLL('libseccomp.so.2')
    except OSError:
        return 'no libseccomp here'
    return None


def eventually(what):
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        if found := what():
            return found
        time.sleep(0.05)
    return what()


@unittest.skipIf(why_not() is not None, why_not())
class Hardening(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        (self.folder / 'state').mkdir()
        self.notified = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.addCleanup(self.notified.close)

    def command(self, unit, *command):
        return [sys.executable, '-B', HERE / 'confine.py', UNITS / unit, self.folder / 'state', server.parent, *command]

    def start(self, unit, *command):
        """Serving, and the port of its gateway."""
        notify = self.folder / 'state' / 'notify'
        self.notified.bind(str(notify))
        self.notified.settimeout(PATIENCE_S)
        notify.chmod(0o777)
        log = (self.folder / 'log').open('w')
        self.addCleanup(log.close)
        process = subprocess.Popen(self.command(unit, *command), stdout=subprocess.PIPE, stderr=log, text=True,
                                   env={**os.environ, 'NOTIFY_SOCKET': '/tmp/state/notify'})
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.kill)
        for line in process.stdout:
            if found := re.search(r'viewer http://127\.0\.0\.1:(\d+)', line):
                return process, int(found.group(1))
        self.fail((self.folder / 'log').read_text())

    def stop(self, process):
        process.send_signal(signal.SIGTERM)
        self.assertEqual(process.wait(PATIENCE_S), 0, (self.folder / 'log').read_text())

    def get(self, port, path, order=None):
        request = urllib.request.Request(f'http://127.0.0.1:{port}{path}')
        if order is not None:
            request.data = json.dumps(order).encode()
            request.add_header('Content-Type', 'application/json')
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
            return answer.read()

    def frames(self, port, stream):
        streams = {s['name']: s for s in json.loads(self.get(port, '/api/streams'))['streams']}
        return streams.get(stream, {}).get('frames', 0)

    def assert_confined(self, process):
        status = pathlib.Path(f'/proc/{process.pid}/status').read_text()
        of = dict(line.split(':\t', 1) for line in status.splitlines() if ':\t' in line)
        self.assertEqual(set(of['Uid'].split()), {'65534'})
        for capabilities in ('CapInh', 'CapPrm', 'CapEff', 'CapBnd', 'CapAmb'):
            self.assertEqual(int(of[capabilities], 16), 0, capabilities)
        self.assertEqual((of['NoNewPrivs'].strip(), of['Seccomp'].strip()), ('1', '2'))

    def hears(self, text):
        return eventually(lambda: text in self.notified.recv(4096).decode())

    def test_what_is_forbidden_fails(self):
        for unit in ('relievo-server.service', 'relievo-web.service'):
            said = subprocess.run(self.command(unit, '/usr/bin/python3', '-c', FORBIDDEN), capture_output=True, text=True)
            self.assertEqual(said.returncode, 0, said.stderr)
            self.assertEqual([what for what, is_so in json.loads(said.stdout).items() if not is_so], [], unit)

    def test_the_server_serves_records_and_stops(self):
        shutil.copy(UNITS / 'server.toml', self.folder / 'state')  # the unit sees no checkout below /home or /tmp
        process, port = self.start(
            'relievo-server.service', '/tmp/programs/relievo-server', 'serve', '--config', '/tmp/state/server.toml', '--web',
            '127.0.0.1:0', '--record-dir', '/tmp/state', '--texture', 'h264', '--geometry', 'metric', '--threads', '2',
            *DOMAIN)
        self.assertTrue(self.hears('READY=1'))
        self.assert_confined(process)
        self.assertTrue(self.hears('WATCHDOG=1'))
        self.assertTrue(eventually(lambda: self.frames(port, 'face') > 10), (self.folder / 'log').read_text())
        self.get(port, '/api/recording/face', {'action': 'start'})
        self.assertTrue(eventually(lambda: json.loads(self.get(port, '/api/recording/face'))['frames'] > 10))
        self.assertIn('exposure', json.loads(eventually(lambda: self.looked_at(port))))
        self.get(port, '/api/recording/face', {'action': 'stop'})
        process.send_signal(signal.SIGHUP)
        self.assertTrue(eventually(lambda: 'was read again' in (self.folder / 'log').read_text()))
        self.stop(process)
        recordings = list((self.folder / 'state').glob('*.mcap'))
        self.assertEqual(len(recordings), 1)
        self.assertEqual(recordings[0].stat().st_mode & 0o777, 0o640)
        info = json.loads(subprocess.run([client, 'info', recordings[0], '--json'], check=True, capture_output=True).stdout)
        self.assertGreater(info['frames'], 10)
        self.assertEqual(info['recovered'], False)

    def looked_at(self, port):
        look = self.get(port, '/api/rig/face')
        return look if b'waiting' not in look else None

    def test_the_gateway_shows_streams(self):
        served = subprocess.Popen([server, 'serve', '--source', 'sim:face', '--web', 'none', *DOMAIN],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(served.wait)
        self.addCleanup(served.kill)
        process, port = self.start('relievo-web.service', '/tmp/programs/relievo', 'web', '--listen', '127.0.0.1:0', *DOMAIN)
        self.assertTrue(self.hears('READY=1'))
        self.assert_confined(process)
        self.assertTrue(eventually(lambda: self.frames(port, 'face') > 10), (self.folder / 'log').read_text())
        with socket.create_connection(('127.0.0.1', port), PATIENCE_S) as browser:
            key = base64.b64encode(os.urandom(16)).decode()
            browser.sendall((f'GET /ws/face HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n'
                             f'Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n').encode())
            self.assertIn(b' 101 ', browser.recv(4096))
        self.stop(process)


class Exposure(unittest.TestCase):
    @unittest.skipIf(shutil.which('systemd-analyze') is None, 'no systemd-analyze here')
    def test_systemd_finds_little_to_say(self):
        for unit in ('relievo-server.service', 'relievo-web.service'):
            said = subprocess.run(['systemd-analyze', 'security', '--offline=true', '--no-pager', UNITS / unit],
                                  capture_output=True, text=True)
            level = float(re.search(r'exposure level for \S+: ([0-9.]+)', said.stdout).group(1))
            self.assertLessEqual(level, MOST_EXPOSURE, said.stdout)


if __name__ == '__main__':
    unittest.main()
