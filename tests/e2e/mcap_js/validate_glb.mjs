// SPDX-License-Identifier: Apache-2.0
// node validate_glb.mjs FILE...: Khronos' glTF validator; exits 1 on an error or a warning.
import { readFile } from "node:fs/promises";
import validator from "gltf-validator";

let failed = process.argv.length < 3;
for (const file of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(await readFile(file)), { uri: file });
  const { numErrors, numWarnings, messages } = report.issues;
  if (numErrors + numWarnings === 0) continue;
  failed = true;
  for (const { code, message, pointer } of messages) console.error(`${file}: ${code} ${message} ${pointer ?? ""}`);
}
process.exit(failed ? 1 : 0);
