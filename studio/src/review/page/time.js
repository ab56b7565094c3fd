// Time: playing, the range, the bar that scrubs, and the curves under it.

const count = data.frames.length;
const time = { place: 0, direction: 0, speed: 1, loop: true, from: null, to: null, carry: 0, last: 0, shown: 0, since: 0, painted: false };

const low = () => time.from ?? 0, top = () => time.to ?? count - 1;

/** Goes to a place of the list of frames. */
function seek(place) {
  time.place = clamp(Math.round(place), 0, count - 1);
  refresh();
}

function step(by) {
  stop();
  seek(time.place + by);
}

function stop() {
  play(0);
}

function play(direction) {
  const starts = direction !== 0 && time.direction === 0;
  time.direction = direction;
  if (starts && !inRange(time.place)) time.place = direction > 0 ? low() : top();
  if (starts && !time.loop && time.place === (direction > 0 ? top() : low())) time.place = direction > 0 ? low() : top();
  if (starts) Object.assign(time, { carry: 0, last: performance.now(), shown: 0, since: performance.now() });
  $("play").setAttribute("aria-pressed", direction > 0);
  $("play").setAttribute("aria-label", direction > 0 ? "Pause" : "Play");
  $("back").setAttribute("aria-pressed", direction < 0);
  if (direction === 0) $("rate").textContent = "";
  refresh();
  if (starts) requestAnimationFrame(tick);
}

const inRange = (place) => place >= low() && place <= top();

function tick(now) {
  if (time.direction === 0) return;
  requestAnimationFrame(tick);
  const elapsed = Math.min(now - time.last, 250);
  time.last = now;
  // The clock stands while the picture at hand is on its way: no frame is left out because it loads slowly.
  if (!time.painted) {
    $("rate").textContent = "loading…";
    return refresh();
  }
  time.carry += (elapsed / 1000) * data.fps * time.speed;
  const steps = Math.floor(time.carry);
  if (steps > 0) {
    time.carry -= steps;
    const length = top() - low() + 1;
    let place = time.place + time.direction * steps;
    if (!inRange(place)) {
      if (!time.loop) {
        time.place = time.direction > 0 ? top() : low();
        return stop();
      }
      place = low() + ((((place - low()) % length) + length) % length);
    }
    time.place = place;
    time.shown++;
    refresh();
  }
  if (now - time.since > 1000) {
    $("rate").textContent = `${((1000 * time.shown) / (now - time.since)).toFixed(1)} frames a second`;
    Object.assign(time, { shown: 0, since: now });
  }
}

let waiting = false;
/** Draws the page anew with the next picture of the screen. */
function refresh() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    const changed = () => refresh();
    first.want(time.place, time.direction, changed);
    if (second && matching[time.place] >= 0) second.want(matching[time.place], time.direction, changed);
    time.painted = paint(time.place);
    canvas.toggleAttribute("data-waits", !time.painted);
    const at = (time.place + 0.5) / count, number = data.frames[time.place];
    $("rows").style.setProperty("--at", at);
    $("counter").replaceChildren(
      `${String(number).padStart(4, "0")} `, element("span", {}, `/ ${data.frames[count - 1]}   `),
      timecode(number - 1, data.fps), element("span", {}, `   ${((number - 1) / data.fps).toFixed(2)} s`));
    $("track").setAttribute("aria-valuemin", data.frames[0]);
    $("track").setAttribute("aria-valuemax", data.frames[count - 1]);
    $("track").setAttribute("aria-valuenow", number);
    $("track").setAttribute("aria-valuetext", `frame ${number} of ${data.frames[count - 1]}, ${((number - 1) / data.fps).toFixed(2)} seconds`);
    showValues();
    showMarks();
    showDrawings();
    showNotes();
    showFrame();
  });
}

function setRange(from, to) {
  Object.assign(time, { from, to });
  if (from != null && to != null && from > to) Object.assign(time, { from: to, to: from });
  refresh();
}

/** The bar: what is loaded, the range, notes, marks of the performance, faults. */
function showMarks() {
  const bar = $("marks"), box = bar.getBoundingClientRect(), ratio = devicePixelRatio;
  const [width, height] = [Math.max(1, Math.round(box.width * ratio)), Math.max(1, Math.round(box.height * ratio))];
  if (bar.width !== width || bar.height !== height) Object.assign(bar, { width, height });
  const on = bar.getContext("2d"), style = getComputedStyle(document.documentElement);
  const color = (name) => style.getPropertyValue(`--${name}`);
  const x = (place) => (place / count) * width;
  on.clearRect(0, 0, width, height);
  // A ruler: numbers of frames, at most one in 60 pixels.
  const gap = [1, 2, 5, 10, 12, 24, 48, 120, 240, 480, 1200, 2400, 4800, 12000, 24000].find((n) => (n * width) / count > 60 * ratio) ?? 48000;
  on.font = `${10.5 * ratio}px system-ui, sans-serif`;
  for (let place = gap - 1; place < count - 1; place += gap) {
    on.fillStyle = color("line");
    on.fillRect(x(place + 0.5), 0, ratio, height);
    on.fillStyle = color("dim");
    on.fillText(data.frames[place], x(place + 0.5) + 4 * ratio, height / 2 + 4 * ratio);
  }
  on.fillStyle = color("loaded");
  const line = 3 * ratio;
  for (const [place, picture] of first.pictures) {
    if (picture.state === "ready") on.fillRect(x(place), height - line, Math.ceil(width / count), line);
  }
  if (time.from != null || time.to != null) {
    on.fillStyle = color("range");
    on.fillRect(x(low()), 0, x(top() + 1) - x(low()), height);
    on.fillStyle = color("text");
    on.fillRect(x(low()), 0, 2 * ratio, height);
    on.fillRect(x(top() + 1) - 2 * ratio, 0, 2 * ratio, height);
  }
  on.fillStyle = color("mark");
  for (const mark of data.marks) {
    const place = first.place.get(mark.frame);
    if (place !== undefined) on.fillRect(x(place + 0.5) - ratio / 2, height - 9 * ratio, ratio, 5 * ratio);
  }
  for (const note of notes) {
    const places = data.frames.flatMap((number, place) => (number >= note.from && number <= note.to ? [place] : []));
    if (places.length === 0) continue;
    on.fillStyle = color(note.done ? "mark" : "note");
    on.fillRect(x(places[0]), 2 * ratio, Math.max(4 * ratio, x(places[places.length - 1] + 1) - x(places[0])), 6 * ratio);
  }
  on.fillStyle = color("warn");
  for (const place of first.faults.keys()) on.fillRect(x(place), height - 3 * line, Math.max(3 * ratio, width / count), 3 * line);
}

/** Scrubs with a pointer that is held on an element; `over` finds the box whose width is the time. */
function scrubs(target, over) {
  const to = (box, event) => {
    const { left, width } = box.getBoundingClientRect();
    seek(Math.floor(clamp((event.clientX - left) / width, 0, 0.999999) * count));
  };
  target.addEventListener("pointerdown", (event) => {
    const box = over(event);
    if (!box) return;
    // The keys stay with the page: arrows in the list of curves would scroll it.
    if (box !== target && event.pointerType === "mouse") event.preventDefault();
    // A finger on the curves may be about to scroll them.
    if (event.pointerType !== "touch" || box === target) target.setPointerCapture(event.pointerId);
    stop();
    to(box, event);
    target.onpointermove = (move) => to(box, move);
  });
  for (const end of ["pointerup", "pointercancel"]) target.addEventListener(end, () => { target.onpointermove = null; });
}
scrubs($("track"), () => $("track"));
scrubs($("lanes"), (event) => event.target.closest(".lane")?.querySelector(".plot"));

// Curves: a row for each that moves, by group.
const GROUPS = [["difference", "Difference"], ["expressions", "Expressions"], ["states", "States"], ["blood", "Blood"], ["wrinkles", "Wrinkles"], ["shapes", "Shapes"]];
const hidden = new Set(["shapes"]);
let lanes = [];

const moves = (curve, value) => value != null && Math.abs(value - curve.rest) > 1e-3;

/** The range that a plot shows. */
function rangeOf(curve) {
  const values = curve.values.filter((v) => v != null);
  if (curve.group === "difference") return [0, Math.max(0.01, ...values)];
  if (curve.rest !== 0) {
    const reach = Math.max(0.25, ...values.map((v) => Math.abs(v - curve.rest)));
    return [curve.rest - reach, curve.rest + reach];
  }
  return [Math.min(0, ...values), Math.max(1, ...values)];
}

function pathOf(values, [from, to], rest) {
  const y = (v) => 1 - (v - from) / (to - from), points = values.flatMap((v, k) => (v == null ? [] : [`${k + 0.5},${y(v).toFixed(4)}`]));
  if (points.length === 0) return ["", ""];
  const end = (k) => points[k].split(",")[0];
  return [`M${points.join("L")}`, `M${end(0)},${y(rest)}L${points.join("L")}L${end(points.length - 1)},${y(rest)}Z`];
}

function buildLanes() {
  $("groups").replaceChildren();
  lanes = [];
  const rows = [];
  for (const [group, title] of GROUPS) {
    const all = data.curves.filter((curve) => curve.group === group);
    const moving = all.filter((curve) => curve.values.some((v) => moves(curve, v)));
    if (all.length === 0) continue;
    const flat = all.length - moving.length;
    const button = element("button", {
      "aria-pressed": !hidden.has(group), style: `--hue: var(--${group})`,
      title: flat ? `${flat} that stay at rest are not listed` : null,
      onclick: () => { hidden[hidden.has(group) ? "delete" : "add"](group); buildLanes(); refresh(); },
    }, `${title} ${moving.length}`);
    $("groups").append(button);
    if (hidden.has(group)) continue;
    for (const curve of moving) {
      const range = rangeOf(curve), [line, area] = pathOf(curve.values, range, curve.rest);
      const plot = element("div", { class: "plot" });
      const other = second?.of.curves.find((c) => c.group === group && c.name === curve.name);
      const values = other && matching.map((place) => (place < 0 ? null : other.values[place]));
      const dashed = values && values.some((v, k) => v != null && Math.abs(v - curve.values[k]) > 1e-3) ? `<path class="second" d="${pathOf(values, range, curve.rest)[0]}"/>` : "";
      plot.innerHTML = `<svg viewBox="0 0 ${count} 1" preserveAspectRatio="none" aria-hidden="true"><path class="area" d="${area}"/><path d="${line}"/>${dashed}</svg>`;
      for (const key of curve.keys ?? []) {
        const place = first.place.get(key);
        if (place !== undefined) plot.append(element("i", { style: `left: ${(100 * (place + 0.5)) / count}%` }));
      }
      const value = element("span", { class: "value" });
      const row = element("div", { class: "lane", style: `--hue: var(--${group})` }, element("span", { class: "name", title: curve.name }, curve.name), plot, value);
      rows.push(row);
      lanes.push({ curve, row, value });
    }
  }
  $("lanes").replaceChildren(...rows);
  $("rows").style.setProperty("--bar", `${$("lanes").offsetWidth - $("lanes").clientWidth}px`);
}

function showValues() {
  for (const { curve, row, value } of lanes) {
    const v = curve.values[time.place];
    value.textContent = v == null ? "–" : v.toFixed(curve.group === "difference" ? 4 : 2);
    row.classList.toggle("moves", moves(curve, v));
  }
}

const on = (id, work) => $(id).addEventListener("click", work);
on("first", () => { stop(); seek(low()); });
on("last", () => { stop(); seek(top()); });
on("previous", () => step(-1));
on("next", () => step(1));
on("play", () => play(time.direction > 0 ? 0 : 1));
on("back", () => play(time.direction < 0 ? 0 : -1));
on("in", () => setRange(time.place, time.to));
on("out", () => setRange(time.from, time.place));
on("all", () => setRange(null, null));
on("loop", () => { time.loop = !time.loop; $("loop").setAttribute("aria-pressed", time.loop); });
$("speed").addEventListener("change", () => { time.speed = Number($("speed").value); });
function setSpeed(speed) {
  time.speed = clamp(speed, 0.1, 4);
  const nearest = [...$("speed").options].reduce((a, b) => (Math.abs(b.value - time.speed) < Math.abs(a.value - time.speed) ? b : a));
  time.speed = Number(nearest.value);
  $("speed").value = nearest.value;
}
