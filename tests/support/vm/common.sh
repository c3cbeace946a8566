# SPDX-License-Identifier: Apache-2.0
# Shared by prepare and run. Sourced, not run.
# shellcheck shell=bash

cache=${XDG_CACHE_HOME:-$HOME/.cache}/relievo-vm
# A name of its own for each state of the sources that it is made of.
prepared=$cache/$(cat "$here/prepare" "$here/guest_init" | sha256sum | head -c 12)

say() { printf 'vm: %s\n' "$*" >&2; }
skip() {
  say "skipped: $*"
  exit 77
}
have_qemu() { command -v qemu-system-x86_64 >/dev/null; }
is_prepared() { [[ -s $prepared/kernel && -s $prepared/disk.cpio && -s $prepared/version ]]; }
