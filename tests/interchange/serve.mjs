// A headless Chromium and a server of this folder, `docs/three.js`, one head and the installed packages.
//
// CHROMIUM names the browser. What is missing is an error: who asks for a browser wants its answer.
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { existsSync, readFileSync, statSync } from "node:fs";
import { dirname, extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const types = {
  ".html": "text/html", ".js": "text/javascript", ".mjs": "text/javascript", ".glb": "model/gltf-binary", ".wasm": "application/wasm",
};

/** Calls `work(newPage)`, where `newPage(page file, size)` opens a page whose errors fail the run. */
export async function withBrowser(head, work) {
  const require = createRequire(join(process.cwd(), "package.json"));
  const { chromium } = require("playwright-core");
  const candidates = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
  const executablePath = process.env.CHROMIUM ?? candidates.find(existsSync);
  if (!executablePath || !existsSync(executablePath))
    throw new Error(`no Chromium at ${executablePath ?? candidates.join(", ")}: install one (Debian: apt-get install chromium) or set CHROMIUM`);
  const server = createServer((request, response) => {
    const path = normalize(decodeURIComponent(new URL(request.url, "http://x").pathname));
    if (path === "/favicon.ico") return response.writeHead(204).end();
    // The viewer's own folder gets its packages from here.
    const packages = /(^|\/three\.js)(\/node_modules\/.*)/.exec(path)?.[2];
    const file = path === "/head.glb" ? head : packages ? join(process.cwd(), packages)
      : join(path.startsWith("/three.js/") ? join(here, "../../docs") : here, path);
    if (!existsSync(file) || !statSync(file).isFile()) return response.writeHead(404).end();
    response.writeHead(200, { "content-type": types[extname(file)] ?? "application/octet-stream" });
    response.end(readFileSync(file));
  });
  await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
  const browser = await chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"],
  });
  const faults = [];
  try {
    await work(async (file, [width, height] = [512, 512]) => {
      const page = await browser.newPage({ viewport: { width, height } });
      page.on("pageerror", (e) => faults.push(`${file}: ${e}`));
      page.on("console", (m) => m.type() === "error" && faults.push(`${file}: ${m.text()}`));
      page.setDefaultTimeout(300000);
      await page.goto(`http://127.0.0.1:${server.address().port}/${file}`);
      await page.waitForFunction("window.ready !== undefined || window.viewer !== undefined");
      return page;
    });
  } finally {
    await browser.close();
    server.close();
  }
  return faults;
}
