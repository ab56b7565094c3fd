// Khronos glTF Validator over files: no errors and no warnings, or exit code 1.
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { createRequire } from "node:module";

const require = createRequire(join(process.cwd(), "package.json"));
const validator = require("gltf-validator");
let bad = 0;
for (const file of process.argv.slice(2)) {
  const read = (uri) => new Uint8Array(readFileSync(join(dirname(file), uri)));
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), {
    maxIssues: 1000,
    externalResourceFunction: async (uri) => read(uri),
  });
  const { numErrors, numWarnings, messages } = report.issues;
  console.log(`validator ${validator.version()}: ${file}: ${numErrors} errors, ${numWarnings} warnings`);
  for (const m of messages.filter((m) => m.severity < 2).slice(0, 20)) console.log(`  ${m.code} ${m.pointer}: ${m.message}`);
  bad += numErrors + numWarnings;
}
process.exit(bad ? 1 : 0);
