// Draws any glTF head in three.js with the camera and the lights of a shot (see the example `interchange_shot`).
//
//   shot.mjs HEAD.glb SHOT.json PICTURE.png [--size W,H] [--plain] [--weights '{"joy": 1}'] [--time SECONDS]
//            [--over OTHER.png]
//
// --over: behind the head stands the background of another picture, such as rubor's: one colour, that of its corner. The share of
// the picture that the head covers is printed, so that a comparison counts the head alone: FLIP over the head is the mean of `rubor compare` divided by it.
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
    weights: { type: "string" }, over: { type: "string" }, time: { type: "string" },
  },
});
const size = values.size.split(",").map(Number);
const options = {
  ...JSON.parse(readFileSync(shot)), size, plain: values.plain,
  over: values.over && `data:image/png;base64,${readFileSync(values.over).toString("base64")}`,
  weights: values.weights && JSON.parse(values.weights), time: values.time === undefined ? undefined : Number(values.time),
};
const faults = await withBrowser(head, async (newPage) => {
  const page = await newPage("shot.html", size);
  const { picture: url, coverage } = await page.evaluate((o) => window.shoot(o), options);
  writeFileSync(picture, Buffer.from(url.slice(url.indexOf(",") + 1), "base64"));
  console.log(`${picture}: coverage ${coverage.toFixed(4)}`);
});
faults.forEach((f) => console.error(f));
process.exit(faults.length ? 1 : 0);
