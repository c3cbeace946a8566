#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Runs a command under the restrictions of a systemd unit, without systemd: as root.

usage: confine.py UNIT STATE PROGRAMS COMMAND...

STATE is the unit's state folder, here /tmp/state, and where COMMAND begins; PROGRAMS is seen as /tmp/programs. What a
directive does here is said beside it; one that this file does not know ends it with an error.
"""
import ctypes
import errno
import functools
import mmap
import os
import socket
import subprocess
import sys

NOBODY = 65534
APPLIED = {
    'User', 'Group', 'StateDirectory', 'WorkingDirectory', 'UMask', 'NoNewPrivileges', 'CapabilityBoundingSet',
    'ProtectSystem', 'ProtectHome', 'PrivateTmp', 'PrivateMounts', 'DevicePolicy', 'ProtectKernelTunables', 'ProtectControlGroups',
    'ProtectProc', 'RestrictAddressFamilies', 'RestrictNamespaces', 'RestrictRealtime', 'RestrictSUIDSGID',
    'LockPersonality', 'MemoryDenyWriteExecute', 'SystemCallArchitectures', 'SystemCallFilter',
    'SystemCallErrorNumber',
}
# Without a capability and with these system calls nobody could; or systemd's part, which restricts nothing.
FOLLOWS = {'ProtectClock', 'ProtectHostname', 'ProtectKernelLogs', 'ProtectKernelModules'}
SYSTEMD = {'Type', 'ExecStart', 'ExecReload', 'Restart', 'RestartSec', 'WatchdogSec', 'TimeoutStopSec',
           'SupplementaryGroups', 'DeviceAllow', 'RemoveIPC', 'EnvironmentFile', 'Environment'}

MS_RDONLY, MS_NOSUID, MS_REMOUNT, MS_BIND, MS_REC, MS_PRIVATE = 1, 2, 32, 4096, 16384, 1 << 18
CLONE_NEWNS = 0x20000
CLONE_NEW_ANY = 0x7E020080  # and cgroups, UTS, IPC, users, processes, network, time
PR_CAPBSET_DROP, PR_SET_NO_NEW_PRIVS = 24, 38
ALLOW, ERRNO, EQUAL, MASKED = 0x7FFF0000, 0x00050000, 4, 7  # seccomp(3)

libc = ctypes.CDLL(None, use_errno=True)


def checked(result, what):
    if result != 0:
        raise OSError(ctypes.get_errno(), f'{what}: {os.strerror(ctypes.get_errno())}')


def mount(source, target, kind=None, flags=0, data=None):
    text = [None if t is None else os.fsencode(t) for t in (source, target, kind, data)]
    checked(libc.mount(text[0], text[1], text[2], ctypes.c_ulong(flags), text[3]), f'mount {target}')


def directives(unit):
    """Of [Service], in order."""
    inside, out = False, []
    with open(unit) as lines:
        for line in map(str.strip, lines):
            if line.startswith('['):
                inside = line == '[Service]'
            elif inside and line and not line.startswith('#'):
                out.append(tuple(line.split('=', 1)))
    unknown = {name for name, _ in out} - APPLIED - FOLLOWS - SYSTEMD
    if unknown:
        raise ValueError(f'{unit}: what does {", ".join(sorted(unknown))} do here?')
    return out


@functools.cache
def system_calls(name):
    """Of a set of systemd's, or the one."""
    if not name.startswith('@'):
        return {name}
    said = subprocess.run(['systemd-analyze', 'syscall-filter', name], check=True, capture_output=True, text=True)
    words = {line.split('#')[0].strip() for line in said.stdout.splitlines()[1:]} - {''}
    return set().union(*(system_calls(word) for word in words))


def allowed_calls(filters):
    allowed = set(system_calls('@default'))
    for value in filters:
        names = set().union(*(system_calls(name) for name in value.lstrip('~').split()))
        allowed = allowed - names if value.startswith('~') else allowed | names
    return allowed


class Compare(ctypes.Structure):
    _fields_ = [('arg', ctypes.c_uint), ('op', ctypes.c_int), ('a', ctypes.c_uint64), ('b', ctypes.c_uint64)]


def restrict_calls(filters, families):
    seccomp = ctypes.CDLL('libseccomp.so.2')
    seccomp.seccomp_init.restype = ctypes.c_void_p
    context = ctypes.c_void_p(seccomp.seccomp_init(ctypes.c_uint32(ERRNO | errno.EPERM)))

    def rule(action, name, *conditions):
        number = seccomp.seccomp_syscall_resolve_name(name.encode())
        if number >= 0:  # of this machine
            array = (Compare * max(1, len(conditions)))(*conditions)
            checked(seccomp.seccomp_rule_add_array(context, ctypes.c_uint32(action), number, len(conditions), array),
                    name)

    never_both = [Compare(2, MASKED, mmap.PROT_WRITE | mmap.PROT_EXEC, bits)
                  for bits in (0, mmap.PROT_WRITE, mmap.PROT_EXEC)]
    no_suid = {'chmod': 1, 'fchmod': 1, 'fchmodat': 2}
    special = {
        'mmap': [[c] for c in never_both],
        'mprotect': [[Compare(2, MASKED, mmap.PROT_EXEC, 0)]],
        'pkey_mprotect': [[Compare(2, MASKED, mmap.PROT_EXEC, 0)]],
        'socket': [[Compare(0, EQUAL, getattr(socket, family), 0)] for family in families],
        'clone': [[Compare(0, MASKED, CLONE_NEW_ANY, 0)]],
        'unshare': [], 'setns': [],
        'personality': [[Compare(0, EQUAL, 0, 0)]],
        'sched_setscheduler': [[Compare(1, EQUAL, policy, 0)] for policy in (0, 3, 5)],  # none of real time
        **{name: [[Compare(arg, MASKED, 0o6000, 0)]] for name, arg in no_suid.items()},
    }
    for name in sorted(allowed_calls(filters) - {'clone3'}):
        for conditions in special.get(name, [[]]):
            rule(ALLOW, name, *conditions)
    rule(ERRNO | errno.ENOSYS, 'clone3')  # its flags lie in memory: who asks is to use clone
    checked(seccomp.seccomp_load(context), 'seccomp_load')


def restrict_files(state, programs):
    checked(libc.unshare(CLONE_NEWNS), 'unshare')
    mount(None, '/', flags=MS_REC | MS_PRIVATE)
    kept = [os.open(folder, os.O_PATH) for folder in (state, programs)]
    with open('/proc/self/mounts') as mounts:
        points = [line.split()[1].encode().decode('unicode_escape') for line in mounts]
    for point in points:
        if not point.startswith('/dev'):
            mount(None, point, flags=MS_REMOUNT | MS_BIND | MS_RDONLY | MS_NOSUID)
    # The standard devices alone.
    nodes = [(name, os.open(f'/dev/{name}', os.O_PATH)) for name in ('null', 'zero', 'full', 'random', 'urandom')]
    mount('tmpfs', '/dev', 'tmpfs', data='mode=755')
    for name, node in nodes:
        open(f'/dev/{name}', 'w').close()
        mount(f'/proc/self/fd/{node}', f'/dev/{name}', flags=MS_BIND)
    os.mkdir('/dev/shm', 0o1777)
    os.chmod('/dev/shm', 0o1777)
    mount('tmpfs', '/tmp', 'tmpfs', data='mode=1777')
    for name, folder in zip(('state', 'programs'), kept):
        os.mkdir(f'/tmp/{name}')
        mount(f'/proc/self/fd/{folder}', f'/tmp/{name}', flags=MS_BIND)
    mount(None, '/tmp/state', flags=MS_REMOUNT | MS_BIND | MS_NOSUID)
    for home in ('/home', '/root', '/run/user'):
        if os.path.isdir(home):
            mount('tmpfs', home, 'tmpfs', MS_RDONLY, 'mode=000')
    os.chdir('/tmp/state')


def main():
    unit, state, programs, *command = sys.argv[1:]
    said = directives(unit)
    of = dict(said)
    filters = [value for name, value in said if name == 'SystemCallFilter']
    allowed_calls(filters)  # asked of systemd-analyze while everything may be
    os.chown(state, NOBODY, NOBODY)
    restrict_files(state, programs)
    os.umask(int(of['UMask'], 8))
    for capability in range(64):
        libc.prctl(PR_CAPBSET_DROP, capability, 0, 0, 0)
    os.setgroups([])
    os.setresgid(NOBODY, NOBODY, NOBODY)
    os.setresuid(NOBODY, NOBODY, NOBODY)
    checked(libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0), 'no new privileges')
    restrict_calls(filters, of['RestrictAddressFamilies'].split())
    os.execv(command[0], command)


if __name__ == '__main__':
    main()
