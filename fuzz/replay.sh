#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# replay.sh MAKE_SEEDS TARGET SOURCE_DIR NAME: runs a fuzz target over its seeds and over corpus/NAME, past findings.
# Only its own seeds are made: what others need (a video encoder, a disk that writes) is theirs to fail for.
set -euo pipefail
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
"$1" "$3" "$folder" "$4"
inputs=("$folder/$4")
if [ -d "$3/fuzz/corpus/$4" ]; then inputs+=("$3/fuzz/corpus/$4"); fi
"$2" "${inputs[@]}"
