// The picture: one of the runs, a wipe or the difference, and the drawings on it.

const view = { mode: "a", wipe: 0.5, gain: 4, zoom: 0 };
const canvas = $("picture"), brush = canvas.getContext("2d");
const [wide, high] = data.size;
canvas.width = wide;
canvas.height = high;

function layOut() {
  const stage = $("stage"), ratio = view.zoom || Math.min(stage.clientWidth / wide, stage.clientHeight / high);
  const pixel = view.zoom ? 1 / devicePixelRatio : 1;
  $("sheet").style.width = `${Math.max(1, wide * ratio * pixel)}px`;
  $("sheet").style.height = `${Math.max(1, high * ratio * pixel)}px`;
  canvas.style.imageRendering = view.zoom >= 2 ? "pixelated" : "auto";
}

/** Paints the frame of a place. Returns whether its pictures are there, or never will be. */
function paint(place) {
  const needsA = view.mode !== "b", needsB = second && view.mode !== "a";
  const a = first.pictures.get(place);
  const other = second ? matching[place] : -1;
  const b = other < 0 ? { state: "fault", fault: `B has no frame that belongs to frame ${data.frames[place]} of A.` } : second.pictures.get(other);
  const shown = [needsA && a, needsB && b].filter((picture) => picture !== false && picture !== null);
  if (shown.some((picture) => !picture || picture.state === "loading")) return false;
  const fault = shown.map((picture) => picture.fault).filter(Boolean).join("\n");
  $("fault").textContent = fault;
  $("fault").hidden = !fault;
  // A picture of another size is still shown behind its fault.
  const readable = (picture) => picture.image?.naturalWidth > 0;
  brush.globalCompositeOperation = "source-over";
  brush.clearRect(0, 0, wide, high);
  const draw = (picture) => { if (readable(picture)) brush.drawImage(picture.image, 0, 0, wide, high); };
  if (needsA) draw(a);
  if (view.mode === "b") draw(b);
  if (view.mode === "wipe") {
    const x = Math.round(view.wipe * wide);
    brush.save();
    brush.beginPath();
    brush.rect(x, 0, wide - x, high);
    brush.clip();
    brush.clearRect(0, 0, wide, high);
    draw(b);
    brush.restore();
  }
  if (view.mode === "difference" && readable(a) && readable(b)) {
    brush.globalCompositeOperation = "difference";
    draw(b);
    // Adding the picture to itself doubles it, and what is over white stays white.
    brush.globalCompositeOperation = "lighter";
    for (let k = 1; k < view.gain; k *= 2) brush.drawImage(canvas, 0, 0);
  }
  canvas.setAttribute("aria-label", `Frame ${data.frames[place]}${second ? `, ${modeName()}` : ""}`);
  return true;
}

function modeName() {
  return { a: `A: ${data.title}`, b: `B: ${second?.of.title}`, wipe: "wipe, A left, B right", difference: `difference × ${view.gain}` }[view.mode];
}

function setMode(mode) {
  if (mode !== "a" && !second) return say("There is no second run: choose its folder with “Second run…”.");
  view.mode = mode;
  for (const button of $("modes").querySelectorAll("button")) {
    button.setAttribute("aria-pressed", button.dataset.mode === mode);
    button.disabled = !second && button.dataset.mode !== "a";
  }
  $("gain").disabled = mode !== "difference";
  $("tag").textContent = second ? modeName() : "";
  $("wipe").hidden = mode !== "wipe";
  refresh();
}

function setWipe(share) {
  view.wipe = clamp(share, 0, 1);
  $("wipe").style.left = `${100 * view.wipe}%`;
  $("wipe").setAttribute("aria-valuenow", Math.round(100 * view.wipe));
  refresh();
}

/** The place of a pointer on the picture, 0 to 1 to the right and down. */
function onPicture(event) {
  const box = canvas.getBoundingClientRect();
  return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
}

$("wipe").addEventListener("pointerdown", (event) => {
  $("wipe").setPointerCapture(event.pointerId);
  $("wipe").onpointermove = (move) => setWipe(onPicture(move)[0]);
});
$("wipe").addEventListener("pointerup", () => { $("wipe").onpointermove = null; });
$("wipe").addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (!step) return;
  setWipe(view.wipe + step * (event.shiftKey ? 0.1 : 0.01));
  event.preventDefault();
  event.stopPropagation();
});
for (const button of $("modes").querySelectorAll("button")) button.addEventListener("click", () => setMode(button.dataset.mode));
$("gain").addEventListener("change", () => { view.gain = Number($("gain").value); setMode(view.mode); });
$("zoom").addEventListener("change", () => { view.zoom = Number($("zoom").value); layOut(); });
new ResizeObserver(layOut).observe($("stage"));

// The pen: lines in parts of the picture's width and height, by pointer or by keys.
const COLORS = [["red", "#ff5a4d"], ["yellow", "#ffd60a"], ["blue", "#5ab0ff"], ["white", "#ffffff"]];
const pen = { on: false, color: COLORS[0][1], strokes: [], stroke: null, cross: null };
const svg = $("drawings");
svg.setAttribute("viewBox", "0 0 1 1");

function setPen(on) {
  pen.on = on;
  pen.cross = null;
  endStroke();
  $("draw").setAttribute("aria-pressed", on);
  svg.classList.toggle("pen", on);
  if (on) {
    stop();
    say("Draw with the pointer, or move the cross with the arrows; space sets the pen down and lifts it; escape ends.");
  }
  showDrawings();
}

function startStroke(point) {
  pen.stroke = { color: pen.color, points: [point] };
  pen.strokes.push(pen.stroke);
}

function extendStroke([x, y]) {
  const short = ([u, v]) => Math.hypot(u - x, v - y) < 0.002;
  if (pen.stroke && !short(pen.stroke.points[pen.stroke.points.length - 1])) pen.stroke.points.push([x, y]);
}

function endStroke() {
  if (pen.stroke) pen.stroke.points = pen.stroke.points.map((point) => point.map((v) => Math.round(v * 1e4) / 1e4));
  pen.stroke = null;
}

svg.addEventListener("pointerdown", (event) => {
  if (!pen.on) return;
  svg.setPointerCapture(event.pointerId);
  startStroke(onPicture(event));
  showDrawings();
});
svg.addEventListener("pointermove", (event) => {
  if (!pen.stroke || pen.cross) return;
  for (const move of event.getCoalescedEvents?.() ?? [event]) extendStroke(onPicture(move));
  showDrawings();
});
svg.addEventListener("pointerup", () => { if (!pen.cross) endStroke(); });

/** Keys of the pen. Returns whether it was one. */
function penKey(event) {
  const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
  if (step) {
    const size = event.shiftKey ? 0.05 : 0.01;
    pen.cross = (pen.cross ?? [0.5, 0.5]).map((v, k) => clamp(v + size * step[k], 0, 1));
    extendStroke(pen.cross);
  } else if (event.key === " ") {
    pen.cross ??= [0.5, 0.5];
    if (pen.stroke) endStroke();
    else startStroke(pen.cross);
  } else if (event.key === "Escape") {
    setPen(false);
  } else {
    return false;
  }
  showDrawings();
  return true;
}

/** The drawings of the notes of this frame, and the one at hand. */
function showDrawings() {
  const shown = [...notesAt(data.frames[time.place]).filter((n) => n.id !== editing?.id).flatMap((n) => n.strokes), ...pen.strokes];
  const space = "http://www.w3.org/2000/svg", lines = [];
  const line = (points, className, color) => {
    const made = document.createElementNS(space, "polyline");
    // A dot is a line of no length.
    made.setAttribute("points", (points.length > 1 ? points : [points[0], points[0]]).map((p) => p.join()).join(" "));
    made.setAttribute("class", className);
    if (color) made.setAttribute("stroke", color);
    lines.push(made);
  };
  for (const stroke of shown) {
    line(stroke.points, "under");
    line(stroke.points, "over", stroke.color);
  }
  if (pen.on && pen.cross) {
    const [x, y] = pen.cross, arm = 0.025;
    line([[x - arm, y], [x + arm, y]], "cross");
    line([[x, y - (arm * wide) / high], [x, y + (arm * wide) / high]], "cross");
  }
  svg.replaceChildren(...lines);
}
