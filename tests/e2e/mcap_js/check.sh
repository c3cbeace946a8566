#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# check.sh WRITE_SAMPLE: a recording that C++ wrote is read by @mcap/core; a changed byte or a cut is noticed. And
# a GLB passes Khronos' validator.
set -euo pipefail
here="$(cd "$(dirname "$0")" && pwd)"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
if [ ! -d "$here/node_modules/@mcap/core" ]; then
  echo "SKIP mcap_js: run npm ci --prefix tests/e2e/mcap_js"
  exit 77
fi
"$1" "$folder/a.mcap"
node "$here/validate.mjs" "$folder/a.mcap" > "$folder/a.json"
node -e '
  const found = JSON.parse(require("fs").readFileSync(process.argv[1]));
  const topic = found.topics[0];
  const ok = found.messages === 60 && found.topics.length === 1 && topic.topic === "test/sample" && topic.count === 60
    && topic.first.message.name === "face" && topic.first.message.number === "0" && topic.last.message.number === "59"
    && topic.last.message.data.bytes === 1000 && found.attachments[0].name === "rig.yaml";
  if (!ok) { console.error(JSON.stringify(found, null, 1)); process.exit(1); }' "$folder/a.json"

size="$(stat -c %s "$folder/a.mcap")"
cp "$folder/a.mcap" "$folder/b.mcap"
printf '\xee' | dd of="$folder/b.mcap" bs=1 seek=$((size / 3)) conv=notrunc status=none
if node "$here/validate.mjs" "$folder/b.mcap" > /dev/null 2>&1; then
  echo "a changed byte was not noticed"; exit 1
fi
head -c $((size / 2)) "$folder/a.mcap" > "$folder/c.mcap"
if node "$here/validate.mjs" "$folder/c.mcap" > /dev/null 2>&1; then
  echo "a cut was not noticed"; exit 1
fi
"$1" "$folder/a.glb"
"$1" "$folder/a.draco.glb"
node "$here/validate_glb.mjs" "$folder/a.glb" "$folder/a.draco.glb"
echo "60 messages read and decoded by @mcap/core"
