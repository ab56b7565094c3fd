// over_head.mjs NAME "LINE OF shot.mjs" "JSON OF rubor compare" MOST: FLIP over the head; exit code 1 above MOST.
const [name, line, json, most] = process.argv.slice(2);
const coverage = Number(/coverage ([0-9.]+)/.exec(line)?.[1]);
const { flipMean: mean } = JSON.parse(json)[0];
const flip = mean / coverage;
if (!(coverage > 0) || !Number.isFinite(flip)) throw new Error(`no head in the picture: ${line}`);
console.log(`${name}: FLIP ${flip.toFixed(4)} over the head (${(100 * coverage).toFixed(0)} % of the picture)`);
process.exit(flip <= Number(most) ? 0 : 1);
