// What the page shows: runs, their pictures, and times.

const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);

/** An element with attributes (null leaves one out), and children that are nodes or text. */
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key === "onclick") made.addEventListener("click", value);
    else if (value != null) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const fileOf = (number) => `frame.${String(number).padStart(4, "0")}.png`;

let spoken;
/** Says something at the bottom of the page for some seconds. */
function say(text) {
  $("status").textContent = text;
  clearTimeout(spoken);
  spoken = setTimeout(() => { $("status").textContent = ""; }, 2000 + 35 * text.length);
}

/** Hours, minutes, seconds and frames of a frame, counted from 0, at the whole rate nearest to `fps`. */
function timecode(frame, fps) {
  const base = Math.max(1, Math.round(fps)), two = (n) => String(n).padStart(2, "0");
  const seconds = Math.floor(frame / base);
  return [Math.floor(seconds / 3600), Math.floor(seconds / 60) % 60, seconds % 60, frame % base].map(two).join(":");
}

// Decoded pictures that may be kept, bytes; 4 for a pixel.
const MEMORY = 96e6 * clamp(navigator.deviceMemory ?? 4, 1, 8);
const AT_ONCE = 6;

/** Frames of one folder. A picture is loading, ready, or has a fault, which is a text. */
class Run {
  constructor(of, locate) {
    this.of = of;
    this.locate = locate;
    this.place = new Map(of.frames.map((number, place) => [number, place]));
    this.pictures = new Map();
    this.faults = new Map();
    this.loading = 0;
    this.most = Math.max(12, Math.floor(MEMORY / (4 * of.size[0] * of.size[1])));
  }

  get count() { return this.of.frames.length; }

  /** Loads the pictures around a place, those in the direction of playing first, and drops those far away. */
  want(place, direction, changed) {
    const count = this.count, wanted = [];
    const ahead = direction === 0 ? 0.5 : 0.8;
    for (let k = 0; k < Math.min(count, Math.ceil(this.most * ahead)); k++) wanted.push((place + (direction < 0 ? -k : k) + count * (k + 1)) % count);
    for (let k = 1; k < Math.min(count, Math.floor(this.most * (1 - ahead))); k++) wanted.push((place + (direction < 0 ? k : -k) + count * (k + 1)) % count);
    const near = new Set(wanted);
    for (const [key, picture] of this.pictures) {
      if (!near.has(key) && picture.state === "ready") this.pictures.delete(key);
    }
    for (const key of near) {
      if (this.loading >= AT_ONCE) break;
      if (!this.pictures.has(key)) this.load(key, () => { changed(key); });
    }
  }

  load(place, then) {
    const number = this.of.frames[place], image = new Image(), picture = { state: "loading", image };
    this.pictures.set(place, picture);
    this.loading++;
    const end = (fault) => {
      this.loading--;
      picture.state = fault ? "fault" : "ready";
      picture.fault = fault;
      if (fault) this.faults.set(place, fault);
      else this.faults.delete(place);
      then();
    };
    const url = this.locate(number), file = this.of.folder + fileOf(number);
    const again = "\nThe same `rubor render` with --resume draws it again.";
    if (!url) return end(`${file}: found no such file, expected frame ${number} of “${this.of.title}”.`);
    image.src = url;
    image.decode().then(() => {
      const [width, height] = this.of.size, found = [image.naturalWidth, image.naturalHeight];
      end(found[0] === width && found[1] === height ? "" : `${file}: found ${found.join(" × ")} pixels, expected ${width} × ${height}.${again}`);
    }, () => end(`${file}: found no picture that can be read, expected frame ${number} of ${this.of.title}.${again}`));
  }
}

const first = new Run(data, (number) => data.folder + fileOf(number));
/** The second run, and the place in it of each place of the first; -1 where it has none. */
let second = null, matching = [];

/** Pairs frames: by number where both have one rate, else by time. Returns what is unlike. */
function pair(run) {
  second = run;
  const unlike = [], a = first.of, b = run.of;
  const same = a.fps === b.fps;
  if (!same) unlike.push(`B has ${b.fps} frames a second, A has ${a.fps}: frames are paired by time.`);
  matching = a.frames.map((number) => run.place.get(same ? number : Math.floor(((number - 1) / a.fps) * b.fps + 1e-6) + 1) ?? -1);
  const lacking = matching.filter((place) => place < 0).length;
  if (lacking > 0) unlike.push(`B has no picture for ${lacking} of the ${a.frames.length} frames of A (A has frames ${span(a.frames)}, B has ${span(b.frames)}).`);
  if (a.size[0] !== b.size[0] || a.size[1] !== b.size[1]) unlike.push(`B has ${b.size.join(" × ")} pixels, A has ${a.size.join(" × ")}: B is scaled.`);
  return unlike;
}

const span = (frames) => (frames.length > 1 ? `${frames[0]} to ${frames[frames.length - 1]}` : `${frames[0]}`);
