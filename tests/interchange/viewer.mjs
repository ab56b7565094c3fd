// The viewer of docs/three.js as a person uses it: opens a head, moves a slider, plays.
//
//   viewer.mjs HEAD.glb FOLDER     writes viewer-neutral.png, viewer-moved.png, viewer-played.png
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { withBrowser } from "./serve.mjs";

const [head, folder] = process.argv.slice(2);
const wrong = [];
const faults = await withBrowser(head, async (newPage) => {
  const page = await newPage("three.js/index.html?head=/head.glb", [720, 640]);
  await page.waitForFunction("document.querySelectorAll('#sliders input').length > 0");
  const shot = async (name) => {
    // Two frames: weights of the skin go to the card with the next one.
    await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
    const bytes = await page.screenshot();
    writeFileSync(join(folder, `viewer-${name}.png`), bytes);
    return bytes;
  };
  const neutral = await shot("neutral");
  const names = await page.$$eval("#sliders label", (labels) => labels.map((l) => l.textContent));
  for (const name of ["anger", "blush"]) if (!names.includes(name)) wrong.push(`no slider for ${name} among ${names}`);
  await page.locator("#sliders label", { hasText: "anger" }).locator("input").fill("1");
  if (neutral.equals(await shot("moved"))) wrong.push("the slider changes nothing");
  await page.click("#play");
  await page.waitForTimeout(3000);
  if (neutral.equals(await shot("played"))) wrong.push("playing changes nothing");
});
[...faults, ...wrong].forEach((f) => console.error(f));
process.exit(faults.length + wrong.length ? 1 : 0);
