#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# replay.sh MAKE_SEEDS TARGET SOURCE_DIR NAME: runs a fuzz target over its seeds and over corpus/NAME, past findings.
# Only its own seeds are made: what others need (a video encoder, a disk that writes) is theirs to fail for. Where it
# fails it says at what, and what room the machine had, since some failures come with the machine's load alone.
set -euo pipefail
folder="$(mktemp -d)"
step="making the seeds of $4"
finish() {
  local status=$?
  if [ "$status" -ne 0 ]; then
    echo "replay.sh: $step ended with status $status$([ "$status" -le 128 ] || echo ", signal $((status - 128))")" >&2
    df -h "$folder" >&2 || true
    grep -E '^(MemAvailable|SwapFree)' /proc/meminfo >&2 || true
    cat /proc/loadavg >&2 || true
  fi
  rm -rf "$folder"
}
trap finish EXIT
"$1" "$3" "$folder" "$4"
inputs=("$folder/$4")
if [ -d "$3/fuzz/corpus/$4" ]; then inputs+=("$3/fuzz/corpus/$4"); fi
step="replaying the input named last"
"$2" "${inputs[@]}"
