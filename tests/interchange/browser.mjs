// three.js and Babylon.js in headless Chromium: vertices at the times of the reference, and a picture of each.
//
//   browser.mjs HEAD.glb REFERENCE_FOLDER [BOUND [VIEWER]]     prints the largest distance in parts of the head's height
//
// Run from a folder with node_modules (see package.json); CHROMIUM names the browser.
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { withBrowser } from "./serve.mjs";

const [glb, folder] = process.argv.slice(2);
const reference = JSON.parse(readFileSync(join(folder, "reference.json")));
const expected = readFileSync(join(folder, "vertices.bin"));
// In parts of the head's height. A compressed file rounds positions and shapes, so its bound is wider.
const bound = Number(process.argv[4] ?? 1e-5);
const viewers = process.argv[5] ? [process.argv[5]] : ["three", "babylon"];
let failed = false;
const faults = await withBrowser(glb, async (newPage) => {
  for (const name of viewers) {
    const page = await newPage(`${name}.html`);
    let worst = 0;
    for (const [i, time] of reference.times.entries()) {
      const base64 = await page.evaluate((t) => window.verticesAt(t), time);
      const found = new Float32Array(Uint8Array.from(Buffer.from(base64, "base64")).buffer);
      const size = reference.vertices * 3;
      if (found.length !== size) throw new Error(`${name}: ${found.length / 3} vertices, expected ${reference.vertices}`);
      for (let k = 0; k < size; k += 3) {
        const d = [0, 1, 2].map((c) => found[k + c] - expected.readFloatLE(4 * (i * size + k + c)));
        worst = Math.max(worst, Math.hypot(...d));
      }
    }
    const share = worst / reference.heightMetres;
    failed ||= !(share <= bound);
    console.log(`${name} ${await page.evaluate("window.ready")}: ${share.toExponential(2)} of the head's height at most`);
    // A time at which no lid is down.
    await page.evaluate((t) => window.verticesAt(t), reference.pictureTime);
    writeFileSync(join(folder, `${name}.png`), await page.screenshot());
    await page.close();
  }
});
faults.forEach((f) => console.error(f));
process.exit(failed || faults.length ? 1 : 0);
