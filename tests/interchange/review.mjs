// The review page as a person uses it, in headless Chromium, from files and without network: plays, scrubs, compares, draws a
// note, exports, imports, by keyboard; bad input; contrast and names by axe; pictures of it.
//
//   review.mjs RUN PAGE OTHER FOLDER
//
// RUN: the folder of a run with an inset. PAGE: a folder of `rubor compare --page`, whose runs differ in every frame. OTHER: a
// run of another size and length. FOLDER gets the pictures. Run from a folder with node_modules (see package.json); CHROMIUM
// names the browser.
import { copyFileSync, cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [run, pair, other, folder] = process.argv.slice(2).map((path) => resolve(path));
const require = createRequire(join(process.cwd(), "package.json"));
const { chromium } = require("playwright-core");
const axe = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const executablePath = process.env.CHROMIUM ?? ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);
if (!executablePath) throw new Error("no Chromium: install one (Debian: apt-get install chromium) or set CHROMIUM");
mkdirSync(folder, { recursive: true });
const scratch = mkdtempSync(join(tmpdir(), "rubor-review-"));
const browser = await chromium.launch({ executablePath, args: ["--no-sandbox"] });
const faults = [];
let checks = 0;
function expect(holds, what) {
  checks++;
  if (!holds) faults.push(what);
}

/** A page of a folder. Errors of the page and requests that leave the machine are faults. */
async function open(at, { width = 1440, height = 900, scheme = "dark", ...more } = {}, context) {
  context ??= await browser.newContext({ viewport: { width, height }, colorScheme: scheme, acceptDownloads: true, ...more });
  const page = await context.newPage();
  page.on("pageerror", (e) => faults.push(`${at}: ${e.stack}`));
  page.on("request", (r) => { if (!/^(file|blob|data):/.test(r.url())) faults.push(`${at}: asked for ${r.url()}`); });
  await page.goto(pathToFileURL(join(at, "review.html")).href);
  await settled(page);
  return page;
}
/** Waits until the picture of the frame at hand is painted. */
async function settled(page) {
  await page.waitForTimeout(80);
  await page.waitForFunction(() => document.querySelector("#picture:not([data-waits])"));
  await page.waitForTimeout(80);
}
const frame = (page) => page.$eval("#track", (t) => Number(t.getAttribute("aria-valuenow")));
const status = (page) => page.textContent("#status");
const picture = async (page) => page.locator("#picture").screenshot();
async function press(page, ...keys) {
  for (const key of keys) await page.keyboard.press(key);
  await settled(page);
}
/** Mean of the red, green and blue of a screenshot, or of a part of it from left to right. */
async function mean(page, png, [from, to] = [0, 1]) {
  return page.evaluate(async ([url, from, to]) => {
    const image = new Image();
    image.src = url;
    await image.decode();
    const canvas = new OffscreenCanvas(image.width, image.height), on = canvas.getContext("2d");
    on.drawImage(image, 0, 0);
    const [x, w] = [Math.floor(from * image.width), Math.floor((to - from) * image.width)];
    const pixels = on.getImageData(x, 0, w, image.height).data;
    return pixels.reduce((sum, v, k) => (k % 4 === 3 ? sum : sum + v), 0) / (0.75 * pixels.length);
  }, [`data:image/png;base64,${png.toString("base64")}`, from, to]);
}
async function exported(page, id) {
  const [download] = await Promise.all([page.waitForEvent("download"), page.locator(id).press("Enter")]);
  const path = join(scratch, download.suggestedFilename());
  await download.saveAs(path);
  return path;
}
async function imported(page, path) {
  const [chooser] = await Promise.all([page.waitForEvent("filechooser"), page.locator("#import").press("Enter")]);
  await chooser.setFiles(path);
  await page.waitForTimeout(200);
}
const data = (at) => JSON.parse(/<script id="data" type="application\/json">(.*?)<\/script>/s.exec(readFileSync(join(at, "review.html"), "utf8"))[1]);
const { frames, fps } = data(run), last = frames[frames.length - 1];

/** Names, roles and contrast by axe-core: WCAG 2 A and AA. */
async function accessible(page, what) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => window.axe.run({ runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"] }));
  for (const v of violations) faults.push(`${what}: ${v.id}: ${v.help}: ${v.nodes.slice(0, 3).map((n) => `${n.html} ${n.any[0]?.message ?? ""}`).join("; ")}`);
  checks++;
}

try {
  // Time.
  let page = await open(run);
  const still = await picture(page);
  await press(page, "End");
  expect((await frame(page)) === last, `End goes to ${await frame(page)}, expected ${last}`);
  expect(!still.equals(await picture(page)), "the last frame looks like the first");
  await press(page, "Home", "ArrowRight", ".", ".", ",");
  expect((await frame(page)) === frames[2], `four steps lead to frame ${await frame(page)}, expected ${frames[2]}`);
  await press(page, "Home", " ");
  await page.waitForTimeout(1000 * Math.min(1.2, (0.6 * frames.length) / fps));
  const playing = await frame(page);
  await press(page, " ");
  const stopped = await frame(page);
  expect(playing > frames[0], `space plays: still at frame ${playing}`);
  await page.waitForTimeout(400);
  expect((await frame(page)) === stopped, "space does not stop it");
  await press(page, "End", "j");
  await page.waitForTimeout(1000 * Math.min(1, (0.5 * frames.length) / fps));
  await press(page, "k");
  expect((await frame(page)) < last, "J does not play backwards");
  await press(page, "l", "l");
  expect((await page.inputValue("#speed")) === "2", "a second L does not double the speed");
  await press(page, "k");
  expect((await page.inputValue("#speed")) === "1", "K does not give the speed back");
  // A range.
  await press(page, "Home", "ArrowRight", "ArrowRight", "i", "ArrowRight", "ArrowRight", "o", " ");
  for (let k = 0; k < 15; k++) {
    await page.waitForTimeout(70);
    const at = await frame(page);
    expect(at >= frames[2] && at <= frames[4], `frame ${at} is played, expected ${frames[2]} to ${frames[4]}`);
  }
  await press(page, " ", "x");
  // Scrubbing by pointer and by keys.
  const bar = await page.locator("#track").boundingBox();
  await page.mouse.move(bar.x + 2, bar.y + 10);
  await page.mouse.down();
  await page.mouse.move(bar.x + bar.width / 2, bar.y + 10, { steps: 6 });
  await settled(page);
  const middle = await frame(page);
  await page.mouse.move(bar.x + bar.width + 50, bar.y + 10, { steps: 6 });
  await page.mouse.up();
  await settled(page);
  expect(Math.abs(middle - frames[Math.floor(frames.length / 2)]) <= 1, `the middle of the bar is frame ${middle}`);
  expect((await frame(page)) === last, `the end of the bar is frame ${await frame(page)}`);
  await page.locator("#track").focus();
  await press(page, "ArrowLeft");
  expect((await frame(page)) === frames[frames.length - 2], "the bar does not follow the arrow keys");
  const lane = await page.locator(".lane .plot").first().boundingBox();
  await page.mouse.click(lane.x + 1, lane.y + 8);
  await settled(page);
  expect((await frame(page)) === frames[0], "a click on a curve goes nowhere");
  const values = () => page.$$eval(".lane", (rows) => rows.map((r) => `${r.querySelector(".name").textContent} ${r.querySelector(".value").textContent}`));
  const before = await values();
  await press(page, "ArrowDown");
  expect((await frame(page)) > frames[0], "no mark after the first frame");
  expect(before.join() !== (await values()).join(), "the weights of another frame are the same");

  // A note with a drawing, by keyboard.
  await press(page, "Home", "ArrowRight", "i", "ArrowRight", "o", "n");
  await page.keyboard.type("More blood in the cheeks & ears");
  await press(page, "Escape", "p", "ArrowLeft", " ", "Shift+ArrowRight", "Shift+ArrowDown", " ", "n");
  await press(page, "Control+Enter");
  const note = () => page.textContent("#notes");
  expect((await note()).includes("More blood in the cheeks & ears"), `no note in ${await note()}`);
  expect((await page.locator("#drawings .over").count()) === 1, "the drawing does not show on its frame");
  await page.screenshot({ path: join(folder, "review-note.png") });
  await press(page, "x", "End");
  expect((await page.locator("#drawings .over").count()) === 0, "the drawing shows on a frame that it is not about");
  const json = await exported(page, "#export"), edl = await exported(page, "#edl");
  const file = JSON.parse(readFileSync(json));
  const found = file.notes?.[0];
  expect(file.format === "rubor review notes" && file.notes.length === 1 && found.from === frames[1] && found.to === frames[2], `exported ${JSON.stringify(file)}`);
  expect(found.strokes[0].points.length === 3 && found.strokes[0].points[0][0] === 0.49, `drawn ${JSON.stringify(found.strokes)}`);
  const list = readFileSync(edl, "utf8");
  const code = `01:00:00:${String(frames[1] - 1).padStart(2, "0")}`;
  expect(list.startsWith("TITLE:") && list.includes(`* LOC: ${code} RED     frames ${frames[1]}-${frames[2]}: More blood in the cheeks & ears`), list);
  copyFileSync(edl, join(folder, "notes.edl"));
  copyFileSync(json, join(folder, "notes.json"));
  // Drawn by pointer, kept in the browser, changed, deleted, imported.
  await press(page, "Home", "p");
  const box = await page.locator("#picture").boundingBox();
  await page.mouse.move(box.x + 0.3 * box.width, box.y + 0.3 * box.height);
  await page.mouse.down();
  await page.mouse.move(box.x + 0.6 * box.width, box.y + 0.5 * box.height, { steps: 8 });
  await page.mouse.up();
  await page.locator("#add").press("Enter");
  await settled(page);
  expect((await page.locator("#notes li:not(.none)").count()) === 2, "a drawing alone is no note");
  await page.reload();
  await settled(page);
  expect((await page.locator("#notes li:not(.none)").count()) === 2, "the notes are gone after a reload");
  const remove = page.locator("#notes button", { hasText: "Delete" });
  while ((await remove.count()) > 0) {
    await remove.first().press("Enter");
    await settled(page);
  }
  expect((await page.locator("#notes li:not(.none)").count()) === 0, "deleted notes stay");
  await imported(page, json);
  expect((await status(page)).includes("1 new"), `import says ${await status(page)}`);
  await imported(page, json);
  expect((await status(page)).includes("1 already here"), `a second import says ${await status(page)}`);
  const again = JSON.parse(readFileSync(await exported(page, "#export")));
  expect(JSON.stringify(again.notes) === JSON.stringify(file.notes), "what is exported again differs");
  const broken = join(scratch, "broken.json");
  for (const [text, phrase] of [["{", "no JSON"], ["{}", "format"], [JSON.stringify({ ...file, notes: [{ ...found, from: "x" }] }), 'from "x" in note 1'],
    [JSON.stringify({ ...file, notes: [{ ...found, strokes: [{ color: "red", points: [[0, 0]] }] }] }), "color"]]) {
    writeFileSync(broken, text);
    await imported(page, broken);
    expect((await status(page)).includes(phrase), `${text.slice(0, 40)}: said ${await status(page)}, expected ${phrase}`);
  }
  expect((await page.locator("#notes li:not(.none)").count()) === 1, "a refused file changed the notes");
  // The numbers of frames and run, and the blood.
  await page.locator("#tab-notes").focus();
  await press(page, "ArrowRight");
  expect((await page.locator("#panel-frame figure canvas").count()) === 1, "no inset");
  expect(/drawn in\s*[\d.]+ s/.test(await page.textContent("#panel-frame")), "no time of the frame");
  await press(page, "ArrowRight");
  expect((await page.textContent("#panel-run")).replaceAll("\u200b", "").includes("quality.scatter"), "no settings");
  const links = await page.$$eval("#panel-run a", (all) => all.map((a) => a.getAttribute("href")));
  for (const link of links) expect(existsSync(join(run, decodeURI(link))), `the link ${link} leads nowhere`);
  // Everything by the tabulator.
  await page.evaluate(() => document.activeElement.blur());
  const reached = new Set();
  for (let k = 0; k < 120; k++) {
    await page.keyboard.press("Tab");
    reached.add(await page.evaluate(() => document.activeElement.id || document.activeElement.className || document.activeElement.tagName));
  }
  for (const id of ["open", "theme", "help", "play", "in", "out", "loop", "speed", "zoom", "track", "lanes", "tab-run"]) expect(reached.has(id), `${id} is not reached by Tab`);
  await page.context().close();

  // Two runs.
  page = await open(pair);
  await press(page, "1");
  const a = await picture(page);
  await press(page, "s");
  const b = await picture(page);
  const [lightA, lightB] = [await mean(page, a), await mean(page, b)];
  expect(Math.abs(lightA - lightB) > 2, `A and B look the same: ${lightA}, ${lightB}`);
  await press(page, "s");
  expect(a.equals(await picture(page)), "S does not lead back to A");
  await press(page, "w");
  for (let k = 0; k < 3; k++) await press(page, "Shift+ArrowRight");
  expect((await page.getAttribute("#wipe", "aria-valuenow")) === "80", "the wipe does not follow the keys");
  const wipe = await picture(page);
  for (const [part, like, name] of [[[0, 0.75], a, "A"], [[0.85, 0.95], b, "B"]]) {
    const [is, should] = [await mean(page, wipe, part), await mean(page, like, part)];
    expect(Math.abs(is - should) < 0.01, `the wipe has ${is} where ${name} has ${should}`);
  }
  await press(page, "d");
  await page.selectOption("#gain", "1");
  await settled(page);
  const apart = await mean(page, await picture(page));
  expect(apart > Math.abs(lightA - lightB) - 1, `the difference is ${apart}, expected at least ${Math.abs(lightA - lightB)}`);
  await page.selectOption("#gain", "4");
  await settled(page);
  expect((await mean(page, await picture(page))) > 2 * apart, "the gain changes nothing");
  await page.locator("#tab-run").click();
  expect((await page.locator("#panel-run tr.differs").count()) > 0, "no setting is marked as different");
  await page.screenshot({ path: join(folder, "review-difference.png") });
  await page.context().close();

  // A folder that is chosen in the page: the same run, then one of another size and length.
  page = await open(run);
  await page.setInputFiles("#folder", run);
  await page.waitForFunction(() => document.querySelector("#tag").textContent !== "");
  await press(page, "d");
  // The rim of a screenshot may have a part of a pixel of the page around the picture.
  expect((await mean(page, await picture(page), [0.1, 0.9])) < 0.5, "a run differs from itself");
  await page.setInputFiles("#folder", other);
  await page.waitForFunction(() => !document.querySelector("#banner").hidden);
  const banner = await page.textContent("#banner");
  expect(banner.includes("B is scaled") && banner.includes("B has no picture for"), `another size and length: said ${banner}`);
  await press(page, "2", "End");
  expect((await page.textContent("#fault")).includes("B has no frame"), "no word on a frame that B does not have");
  const empty = join(scratch, "empty");
  mkdirSync(empty);
  writeFileSync(join(empty, "a.txt"), "");
  await page.setInputFiles("#folder", empty);
  await page.waitForFunction(() => document.querySelector("#status").textContent.includes("found no frames"));
  await page.context().close();

  // Missing, broken and wrong pictures.
  const hurt = join(scratch, "hurt");
  cpSync(run, hurt, { recursive: true });
  const picturesOf = (at) => readdirSync(at).filter((n) => /^frame\.\d+\.png$/.test(n)).sort();
  const [one, two, three] = picturesOf(hurt);
  rmSync(join(hurt, one));
  writeFileSync(join(hurt, two), "half");
  copyFileSync(join(other, picturesOf(other)[0]), join(hurt, three));
  page = await open(hurt);
  for (const [name, phrase] of [[one, "found no picture"], [two, "found no picture"], [three, "pixels, expected"]]) {
    const said = await page.textContent("#fault");
    expect(said.includes(name) && said.includes(phrase) && said.includes("--resume"), `${name}: said ${said}`);
    if (name === one) await page.screenshot({ path: join(folder, "review-missing.png") });
    await press(page, "ArrowRight");
  }
  expect(await page.locator("#fault").isHidden(), "the fault stays on a frame that is there");
  await press(page, "Home", " ");
  await page.waitForTimeout(1000 * Math.max(1, 5 / fps));
  expect((await frame(page)) > frames[2], "playing stops at a missing frame");
  await page.context().close();

  // Both themes, large and small.
  for (const scheme of ["light", "dark"]) {
    for (const [name, at, view] of [["large", run, {}], ["pair", pair, {}], ["small", run, { width: 390, height: 844, hasTouch: true, isMobile: true, deviceScaleFactor: 2 }]]) {
      page = await open(at, { scheme, ...view });
      await press(page, ...Array(Math.floor(0.4 * frames.length)).fill("ArrowRight"));
      for (const tab of ["notes", "frame", "run"]) {
        await page.locator(`#tab-${tab}`).click();
        await settled(page);
        await accessible(page, `${name}, ${scheme}, ${tab}`);
      }
      if (name !== "small") await page.locator("#tab-frame").click();
      await page.evaluate(() => scrollTo(0, 0));
      await settled(page);
      await page.screenshot({ path: join(folder, `review-${name}-${scheme}.png`) });
      if (name === "small") {
        expect(await page.evaluate(() => document.scrollingElement.scrollWidth <= innerWidth), "a phone has to scroll sideways");
        const from = await frame(page);
        await page.locator("#next").tap();
        await settled(page);
        expect((await frame(page)) === from + 1, "a tap on the next frame does nothing");
        await page.screenshot({ path: join(folder, `review-${name}-${scheme}-all.png`), fullPage: true });
      }
      await page.keyboard.press("?");
      await accessible(page, `${name}, ${scheme}, keys`);
      await page.context().close();
    }
    // The switch wins over the system.
    page = await open(run, { scheme });
    const ground = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    const bySystem = await ground();
    await press(page, "t");
    if (scheme === "light") await press(page, "t");
    expect(bySystem !== (await ground()), `the switch does not change the ${scheme} theme`);
    await page.context().close();
  }
} finally {
  await browser.close();
  rmSync(scratch, { recursive: true, force: true });
}
faults.forEach((f) => console.error(f));
console.log(`review page: ${checks} checks, ${faults.length} faults`);
process.exit(faults.length ? 1 : 0);
