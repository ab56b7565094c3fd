// Draws any glTF head in three.js with the camera and the lights of a shot (see the example `interchange_shot`).
//
//   shot.mjs HEAD.glb SHOT.json PICTURE.png [--size W,H] [--plain] [--weights '{"joy": 1}'] [--time SECONDS]
//
// --plain: as viewers show it that do not know RUBOR_facial_appearance; without it docs/three.js draws blood and wrinkles.
// Lights are directional lamps without shadow; there is no environment and no tone map.
import { readFileSync, writeFileSync } from "node:fs";
import { parseArgs } from "node:util";
import { withBrowser } from "./serve.mjs";

const { values, positionals: [head, shot, picture] } = parseArgs({
  allowPositionals: true,
  options: {
    size: { type: "string", default: "512,512" }, plain: { type: "boolean", default: false },
    weights: { type: "string" }, time: { type: "string" },
  },
});
const size = values.size.split(",").map(Number);
const options = {
  ...JSON.parse(readFileSync(shot)), size, plain: values.plain,
  weights: values.weights && JSON.parse(values.weights), time: values.time === undefined ? undefined : Number(values.time),
};
const faults = await withBrowser(head, async (newPage) => {
  const page = await newPage("shot.html", size);
  const url = await page.evaluate((o) => window.shoot(o), options);
  writeFileSync(picture, Buffer.from(url.slice(url.indexOf(",") + 1), "base64"));
});
faults.forEach((f) => console.error(f));
process.exit(faults.length ? 1 : 0);
