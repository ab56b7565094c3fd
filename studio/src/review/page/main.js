// Panels, keys, the second run, and the start.

const TABS = ["notes", "frame", "run"];
function showTab(name) {
  for (const tab of TABS) {
    const chosen = tab === name;
    $(`tab-${tab}`).setAttribute("aria-selected", chosen);
    $(`tab-${tab}`).tabIndex = chosen ? 0 : -1;
    $(`panel-${tab}`).hidden = !chosen;
  }
  refresh();
}
for (const [k, tab] of TABS.entries()) {
  on(`tab-${tab}`, () => showTab(tab));
  $(`tab-${tab}`).addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!by) return;
    const next = TABS[(k + by + TABS.length) % TABS.length];
    showTab(next);
    $(`tab-${next}`).focus();
    event.preventDefault();
    event.stopPropagation();
  });
}

/** A row for each name with its values; numbers are aligned. `marks`: rows whose values differ are marked. */
function table(rows, marks = false) {
  // Long names may break between their words.
  const breakable = (name) => name.replace(/\./g, ".\u200b").replace(/([a-z])([A-Z])/g, "$1\u200b$2");
  return element("table", {}, element("tbody", {}, ...rows.map(([name, ...values]) => {
    const differs = marks && values.some((v) => v !== values[0]);
    const isNumber = values.some((v) => typeof v === "number");
    const cells = values.map((v) => element("td", { class: isNumber ? "number" : null }, typeof v === "number" ? v.toFixed(3) : v ?? "–"));
    return element("tr", { class: differs ? "differs" : null }, element("th", { scope: "row" }, breakable(name)), ...cells);
  })));
}

const titled = (title, ...content) => element("section", {}, element("h2", {}, title), ...content);

/** Numbers of the frame at hand. */
function showFrame() {
  const panel = $("panel-frame");
  if (panel.hidden) return;
  const place = time.place, number = data.frames[place], other = second ? matching[place] : -1;
  const both = (work) => (second ? [work(data, place), other < 0 ? null : work(second.of, other)] : [work(data, place)]);
  const cost = (of, at, name) => of.cost?.passes?.[name]?.[at] ?? null;
  const parts = [];
  if (data.inset) {
    const figure = element("figure", {});
    for (const [run, at] of [[first, place], [second, other]]) {
      const rect = run?.of.inset?.rect, picture = run?.pictures.get(at);
      if (!rect || picture?.state !== "ready") continue;
      const [x, y, w, h] = rect, shown = element("canvas", { width: 2 * w, height: 2 * h, role: "img", "aria-label": `${run.of.inset.name} at frame ${number}` });
      shown.getContext("2d").drawImage(picture.image, x, y, w, h, 0, 0, 2 * w, 2 * h);
      figure.append(shown);
    }
    figure.append(element("figcaption", {}, data.inset.about));
    parts.push(titled(data.inset.name === "hemoglobin" ? "Blood" : "Wrinkles", figure));
  }
  const marks = data.marks.filter((mark) => mark.frame <= number && number < mark.frame + mark.frames);
  parts.push(titled("Frame", table([
    ["number", String(number)], ["timecode", timecode(number - 1, data.fps)], ["second", ((number - 1) / data.fps).toFixed(3)],
    ["file", fileOf(number)],
    ["drawn in", ...both((of, at) => (of.cost?.seconds?.[at] == null ? "kept from an earlier run" : `${of.cost.seconds[at].toFixed(3)} s`))],
    ["marks", marks.map((mark) => mark.name).join(", ") || "none"],
  ])));
  const passes = Object.keys(data.cost?.passes ?? {}).filter((name) => both((of, at) => cost(of, at, name)).some((v) => v != null));
  if (passes.length > 0) {
    const rows = passes.map((name) => [name, ...both((of, at) => cost(of, at, name))]);
    const sum = both((of, at) => passes.reduce((total, name) => total + (cost(of, at, name) ?? 0), 0));
    parts.push(titled("Milliseconds on the device", table([...rows, ["all", ...sum]])));
  }
  const moving = data.curves.filter((curve) => curve.group !== "difference" && moves(curve, curve.values[place]));
  parts.push(titled(`Weights that are not at rest (${moving.length})`, table(moving.map((curve) => [
    curve.name, ...both((of, at) => (of.curves.find((c) => c.group === curve.group && c.name === curve.name) ?? curve).values[at]),
  ]))));
  panel.replaceChildren(...parts);
}

/** What is the same for all frames. */
function showRun() {
  const runs = second ? [data, second.of] : [data];
  const parts = [];
  if (second) parts.push(titled("Runs", table([["A", data.title], ["B", second.of.title]]), element("p", {}, "Settings that differ are marked.")));
  const names = [...new Set(runs.flatMap((of) => of.settings.map(([name]) => name)))];
  const setting = (of, name) => of.settings.find(([n]) => n === name)?.[1] ?? "unknown";
  parts.push(titled("Settings", table(names.map((name) => [name, ...runs.map((of) => setting(of, name))]), true)));
  const facts = [...new Set(runs.flatMap((of) => of.facts.map(([name]) => name)))];
  parts.push(titled("Measured", table(facts.map((name) => [name, ...runs.map((of) => of.facts.find(([n]) => n === name)?.[1] ?? "–")]))));
  if (data.notes.length > 0) parts.push(titled("Remarks", element("ul", { class: "plain" }, ...data.notes.map((note) => element("li", {}, note)))));
  const files = data.files.map((file) => element("li", {}, element("a", { href: data.folder + encodeURI(file) }, file)));
  if (files.length > 0) parts.push(titled("Files", element("ul", { class: "plain" }, ...files)));
  $("panel-run").replaceChildren(...parts);
}

/** Shows a run as B, and says what is unlike. */
function compareWith(run, remarks = []) {
  const unlike = [...remarks, ...pair(run)];
  $("banner").textContent = unlike.join("\n");
  $("banner").hidden = unlike.length === 0;
  $("title").textContent = document.title = `${data.title} | ${run.of.title}`;
  buildLanes();
  showRun();
  setMode("wipe");
}

/** A second run from the files of a folder that the user chose. */
async function openFolder(files) {
  const pictures = new Map(), named = new Map();
  for (const file of files) {
    // Only the folder itself: FOLDER/frame.0001.png.
    if (file.webkitRelativePath.split("/").length > 2) continue;
    const frame = /^frame\.(\d{4,})\.png$/.exec(file.name);
    if (frame) pictures.set(Number(frame[1]), file);
    else named.set(file.name, file);
  }
  const title = files[0]?.webkitRelativePath.split("/")[0] ?? "folder";
  if (pictures.size === 0) return say(`${title}: found no frames, expected frame.0001.png and so on, as \`rubor render\` writes them.`);
  const frames = [...pictures.keys()].sort((a, b) => a - b), remarks = [];
  const urls = new Map();
  const locate = (number) => {
    if (!pictures.has(number)) return null;
    if (!urls.has(number)) urls.set(number, URL.createObjectURL(pictures.get(number)));
    return urls.get(number);
  };
  let of = null;
  try {
    const page = new DOMParser().parseFromString(await named.get("review.html").text(), "text/html");
    of = JSON.parse(page.getElementById("data").textContent);
    of = { ...of, title, folder: "", files: [] };
    const gone = of.frames.filter((number) => !pictures.has(number)).length;
    if (gone > 0) remarks.push(`B lacks the pictures of ${gone} of its ${of.frames.length} frames.`);
  } catch {
    const image = new Image();
    image.src = locate(frames[0]);
    try {
      await image.decode();
    } catch {
      return say(`${title}: found no picture that can be read in ${pictures.get(frames[0]).name}.`);
    }
    of = { title, folder: "", fps: data.fps, frames, size: [image.naturalWidth, image.naturalHeight], curves: [], settings: [], facts: [], notes: [], files: [], marks: [] };
    remarks.push("B has no review.html that can be read: its rate is taken to be that of A, its weights and settings are unknown.");
  }
  compareWith(new Run(of, locate), remarks);
}
on("open", () => $("folder").click());
$("folder").addEventListener("change", () => { const files = [...$("folder").files]; $("folder").value = ""; if (files.length > 0) openFolder(files); });

const THEMES = ["system", "light", "dark"];
function setTheme(theme) {
  if (theme === "system") delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = theme;
  const name = theme[0].toUpperCase() + theme.slice(1);
  $("theme").textContent = `◐ ${name}`;
  $("theme").setAttribute("aria-label", `Theme: ${name}`);
  try { localStorage.setItem("rubor-review:theme", theme); } catch { /* It is chosen again next time. */ }
  refresh();
}
on("theme", () => setTheme(THEMES[(THEMES.indexOf(document.documentElement.dataset.theme ?? "system") + 1) % THEMES.length]));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", refresh);

const KEYS = [
  ["Time", [["space", "play, pause"], ["J K L", "play backwards, stop, play; again: faster; with K held: one frame"], ["← →  , .", "one frame; with shift ten"],
    ["↑ ↓", "the mark or note before, after"], ["Home End", "start, end of the range"], ["I O X", "start of the range, its end, no range"], ["R", "start again at the end"], ["- =", "slower, faster"]]],
  ["Runs", [["1 2", "A, B"], ["S", "switch between A and B"], ["W", "wipe; arrows move it while it has the focus"], ["D", "difference"]]],
  ["Notes", [["N", "write"], ["Ctrl Enter", "keep the note"], ["P", "draw: arrows move the cross, space sets the pen down and lifts it"], ["Z", "take the last line away"], ["Esc", "leave the pen or the text"]]],
  ["Page", [["F", "fit, or pixel for pixel"], ["T", "theme"], ["?", "this list"]]],
];
$("keys").append(
  ...KEYS.flatMap(([title, rows]) => [element("h2", {}, title), element("table", {}, element("tbody", {}, ...rows.map(([key, does]) =>
    element("tr", {}, element("th", { scope: "row" }, element("kbd", {}, key)), element("td", {}, does)))))]),
  element("form", { method: "dialog" }, element("button", {}, "Close")));
on("help", () => $("keys").showModal());

/** The next frame in a direction at which something is marked. */
function toMark(direction) {
  const at = [...data.marks.map((mark) => mark.frame), ...notes.map((note) => note.from)].map((n) => first.place.get(n)).filter((p) => p !== undefined);
  const beyond = at.filter((place) => direction * (place - time.place) > 0);
  stop();
  if (beyond.length > 0) seek(direction > 0 ? Math.min(...beyond) : Math.max(...beyond));
}

let kHeld = false;
const shuttle = (direction) => {
  if (kHeld) return step(direction);
  if (time.direction === direction) setSpeed(Math.max(1, time.speed) * 2);
  else if (time.speed > 1) setSpeed(1);
  play(direction);
};
const COMMANDS = {
  " ": () => play(time.direction !== 0 ? 0 : 1),
  j: () => shuttle(-1), k: () => { kHeld = true; stop(); setSpeed(Math.min(1, time.speed)); }, l: () => shuttle(1),
  ArrowLeft: (e) => step(e.shiftKey ? -10 : -1), ArrowRight: (e) => step(e.shiftKey ? 10 : 1), ",": () => step(-1), ".": () => step(1),
  ArrowUp: () => toMark(-1), ArrowDown: () => toMark(1),
  Home: () => $("first").click(), End: () => $("last").click(),
  i: () => $("in").click(), o: () => $("out").click(), x: () => $("all").click(), r: () => $("loop").click(),
  "-": () => setSpeed(time.speed / 2), "=": () => setSpeed(time.speed * 2), "+": () => setSpeed(time.speed * 2),
  1: () => setMode("a"), 2: () => setMode("b"), s: () => setMode(view.mode === "b" ? "a" : "b"), w: () => { setMode("wipe"); $("wipe").focus(); }, d: () => setMode("difference"),
  n: () => { stop(); showTab("notes"); $("text").focus(); }, p: () => { showTab("notes"); setPen(!pen.on); }, z: () => $("undo").click(),
  f: () => { $("zoom").value = view.zoom === 0 ? "1" : "0"; $("zoom").dispatchEvent(new Event("change")); },
  t: () => $("theme").click(), "?": () => $("help").click(),
};
addEventListener("keydown", (event) => {
  const writes = event.target.closest("textarea, select, input, dialog");
  if (event.target === $("text")) {
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) $("form").requestSubmit();
    if (event.key === "Escape") $("text").blur();
  }
  if (writes || event.ctrlKey || event.metaKey || event.altKey) return;
  if (pen.on && penKey(event)) return event.preventDefault();
  // A button with the focus is pressed by space, a list is scrolled by arrows up and down.
  if (event.key === " " && event.target.closest("button, a")) return;
  if (/^Arrow(Up|Down)$/.test(event.key) && event.target.closest("#lanes, [role=tabpanel]")) return;
  const command = COMMANDS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!command || (event.repeat && !/^(Arrow|,|\.)/.test(event.key))) return;
  event.preventDefault();
  command(event);
});
addEventListener("keyup", (event) => { if (event.key.toLowerCase() === "k") kHeld = false; });
// After a click the keys belong to the page again, not to the button.
addEventListener("click", (event) => { if (event.detail > 0) event.target.closest("button:not([role=tab])")?.blur(); });
addEventListener("resize", refresh);

document.title = `${data.title} · review`;
$("title").textContent = data.title;
$("facts").textContent = `${count} frames · ${data.fps} a second · ${data.size.join(" × ")}`;
let theme = "system";
try { theme = localStorage.getItem("rubor-review:theme") ?? theme; } catch { /* As the system says. */ }
setTheme(THEMES.includes(theme) ? theme : "system");
restore();
buildLanes();
showRun();
layOut();
setMode("a");
setWipe(0.5);
if (data.second) compareWith(new Run(data.second, (number) => data.second.folder + fileOf(number)));
addEventListener("storage", (event) => { if (event.key === KEY) { restore(); listed = ""; refresh(); } });
