// three.js and Babylon.js in headless Chromium: vertices at the times of the reference, and a picture of each.
//
//   browser.mjs HEAD.glb REFERENCE_FOLDER     prints the largest distance in parts of the head's height
//
// Run from a folder with node_modules (see package.json); CHROMIUM names the browser.
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { readFileSync, writeFileSync, existsSync } from "node:fs";
import { join, extname, dirname } from "node:path";
import { fileURLToPath } from "node:url";

const [glb, folder] = process.argv.slice(2);
const require = createRequire(join(process.cwd(), "package.json"));
const { chromium } = require("playwright-core");
const reference = JSON.parse(readFileSync(join(folder, "reference.json")));
const expected = readFileSync(join(folder, "vertices.bin"));
const here = dirname(fileURLToPath(import.meta.url));
const types = { ".html": "text/html", ".js": "text/javascript", ".mjs": "text/javascript", ".glb": "model/gltf-binary" };
const server = createServer((request, response) => {
  const path = decodeURIComponent(new URL(request.url, "http://x").pathname);
  const file = path === "/head.glb" ? glb : path.startsWith("/node_modules/") ? join(process.cwd(), path) : join(here, path);
  if (!existsSync(file)) return response.writeHead(404).end();
  response.writeHead(200, { "content-type": types[extname(file)] ?? "application/octet-stream" });
  response.end(readFileSync(file));
});
await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
const executablePath = process.env.CHROMIUM ?? ["/usr/bin/chromium", "/usr/bin/google-chrome"].find(existsSync);
if (!executablePath) {
  console.log("SKIPPED: no Chromium (set CHROMIUM)");
  process.exit(0);
}
const browser = await chromium.launch({
  executablePath,
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"],
});
let failed = false;
for (const name of ["three", "babylon"]) {
  const page = await browser.newPage({ viewport: { width: 512, height: 512 } });
  page.on("pageerror", (e) => console.log(`${name}: ${e}`));
  page.setDefaultTimeout(300000);
  await page.goto(`http://127.0.0.1:${server.address().port}/${name}.html`);
  await page.waitForFunction("window.ready !== undefined");
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
  failed ||= !(share <= 1e-5);
  console.log(`${name} ${await page.evaluate("window.ready")}: ${share.toExponential(2)} of the head's height at most`);
  await page.evaluate((t) => window.verticesAt(t), reference.times[5]);
  writeFileSync(join(folder, `${name}.png`), await page.screenshot());
  await page.close();
}
await browser.close();
server.close();
process.exit(failed ? 1 : 0);
