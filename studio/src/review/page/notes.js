// Notes: words and drawings on a frame or a range, kept in this browser; files of them.

const KEY = `rubor-review:${data.id}`;
const FORMAT = "rubor review notes", VERSION = 1;
const MOST_NOTES = 10000, MOST_WORDS = 20000, MOST_POINTS = 1000000;
let notes = [], editing = null, draft = "";

const notesAt = (number) => notes.filter((note) => number >= note.from && number <= note.to);
const places = (note) => (note.from === note.to ? `frame ${note.from}` : `frames ${note.from} to ${note.to}`);

function restore() {
  let text = null;
  try {
    text = localStorage.getItem(KEY);
  } catch (error) {
    return say(`This browser keeps no notes (${error.message}): export them before you close the page.`);
  }
  if (!text) return;
  try {
    notes = checked(JSON.parse(text), "the notes in this browser");
  } catch (error) {
    say(`${error.message} They are left out.`);
  }
}

function keep() {
  notes.sort((a, b) => a.from - b.from || a.to - b.to || a.changed.localeCompare(b.changed));
  try {
    localStorage.setItem(KEY, JSON.stringify(notesFile()));
  } catch (error) {
    say(`The notes cannot be kept in this browser (${error.message}): export them.`);
  }
  listed = "";
  refresh();
}

/** The file of the notes. */
function notesFile() {
  const run = { id: data.id, title: data.title, fps: data.fps, size: data.size, frames: [data.frames[0], data.frames[count - 1]] };
  return { format: FORMAT, version: VERSION, run, notes };
}

/** The notes of a file, each of them as it should be. */
function checked(file, name) {
  const refuse = (found, expected) => { throw new Error(`${name}: found ${found}, expected ${expected}.`); };
  if (file?.format !== FORMAT) refuse(`the format ${JSON.stringify(file?.format)}`, JSON.stringify(FORMAT));
  if (file.version !== VERSION) refuse(`version ${JSON.stringify(file.version)}`, VERSION);
  if (!Array.isArray(file.notes)) refuse(`notes that are no list`, "a list of notes");
  if (file.notes.length > MOST_NOTES) refuse(`${file.notes.length} notes`, `at most ${MOST_NOTES}`);
  let points = 0;
  return file.notes.map((note, k) => {
    const wrong = (field, value, expected) => refuse(`${field} ${JSON.stringify(value)} in note ${k + 1}`, expected);
    const isFrame = (n) => Number.isInteger(n) && n >= 1;
    if (!isFrame(note?.from)) wrong("from", note?.from, "a frame number");
    if (!isFrame(note.to) || note.to < note.from) wrong("to", note.to, `a frame number from ${note.from}`);
    if (typeof note.text !== "string" || note.text.length > MOST_WORDS) wrong("text", typeof note.text, `text of at most ${MOST_WORDS} characters`);
    if (typeof note.id !== "string" || note.id.length > 100) wrong("id", note.id, "a name");
    const strokes = note.strokes ?? [];
    if (!Array.isArray(strokes)) wrong("strokes", strokes, "a list");
    for (const stroke of strokes) {
      if (!/^#[0-9a-f]{6}$/i.test(stroke?.color)) wrong("color", stroke?.color, "a colour such as #ff5a4d");
      const isPoint = (p) => Array.isArray(p) && p.length === 2 && p.every(Number.isFinite);
      if (!Array.isArray(stroke.points) || stroke.points.length === 0 || !stroke.points.every(isPoint)) wrong("points", "something else", "pairs of numbers");
      if ((points += stroke.points.length) > MOST_POINTS) refuse("too many points", `at most ${MOST_POINTS}`);
    }
    const changed = Number.isNaN(Date.parse(note.changed)) ? new Date(0).toISOString() : new Date(note.changed).toISOString();
    return { id: note.id, from: note.from, to: note.to, text: note.text, strokes, done: note.done === true, changed };
  });
}

/** Takes the notes of a file's text into those here; of two with one id the later one stays. */
function take(text, name) {
  let file, found;
  try {
    file = JSON.parse(text);
  } catch (error) {
    return say(`${name}: found no JSON (${error.message}), expected notes that this page exported.`);
  }
  try {
    found = checked(file, name);
  } catch (error) {
    return say(error.message);
  }
  const known = new Map(notes.map((note) => [note.id, note]));
  let added = 0, replaced = 0;
  for (const note of found) {
    const old = known.get(note.id);
    if (!old) added++;
    else if (old.changed < note.changed) replaced++;
    else continue;
    known.set(note.id, note);
  }
  notes = [...known.values()];
  const outside = found.filter((note) => note.to < data.frames[0] || note.from > data.frames[count - 1]).length;
  const remarks = [
    file.run?.id !== data.id && `they were made on another run (${file.run?.title ?? "unnamed"})`,
    outside > 0 && `${outside} are on frames that this run does not have`,
  ].filter(Boolean);
  keep();
  say(`${name}: ${added} new, ${replaced} changed, ${found.length - added - replaced} already here${remarks.length ? `; ${remarks.join("; ")}` : ""}.`);
}

/** The notes as markers of a CMX 3600 edit list: one event, a locator for each note. */
function editList() {
  const base = Math.max(1, Math.round(data.fps)), start = 3600 * base;
  // Locators are one line of ASCII.
  const plain = (text) => text.normalize("NFKD").replace(/\s+/g, " ").replace(/[^\x20-\x7e]/g, "").trim();
  const at = (frame) => timecode(frame, data.fps), last = data.frames[count - 1];
  const lines = [
    `TITLE: ${plain(data.title) || "rubor"}`, "FCM: NON-DROP FRAME", "",
    `001  AX       V     C        ${at(0)} ${at(last)} ${at(start)} ${at(start + last)}`,
    `* FROM CLIP NAME: ${plain(data.title) || "rubor"}`,
  ];
  for (const note of notes) {
    const range = note.from === note.to ? "" : `frames ${note.from}-${note.to}: `;
    const words = plain(note.text) || (note.strokes.length ? "drawing" : "note");
    lines.push(`* LOC: ${at(start + note.from - 1)} ${note.done ? "GREEN" : "RED"}     ${range}${words}`);
  }
  return `${lines.join("\r\n")}\r\n`;
}

function download(text, name, type) {
  const url = URL.createObjectURL(new Blob([text], { type }));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

const baseName = () => data.title.replace(/[^\p{L}\p{N}._-]+/gu, "_") || "review";
on("export", () => { download(`${JSON.stringify(notesFile(), null, 1)}\n`, `${baseName()}.notes.json`, "application/json"); say(`${notes.length} notes exported.`); });
on("edl", () => {
  download(editList(), `${baseName()}.edl`, "text/plain");
  const base = Math.max(1, Math.round(data.fps));
  const counts = base === data.fps ? "" : ` Timecodes count ${base} frames a second, the run has ${data.fps}.`;
  const rare = [24, 25, 30, 48, 50, 60].includes(base) ? "" : ` Not every program reads timecodes of ${base} frames a second.`;
  say(`${notes.length} markers exported.${counts}${rare}`);
});
on("import", () => $("notes-file").click());
$("notes-file").addEventListener("change", async () => {
  const [file] = $("notes-file").files;
  $("notes-file").value = "";
  if (file) take(await file.text(), file.name);
});

/** The frames that a new note is about: the range, if the frame at hand is in one that was set. */
function subject() {
  if (editing) return editing;
  const ranged = (time.from != null || time.to != null) && inRange(time.place);
  return ranged ? { from: data.frames[low()], to: data.frames[top()] } : { from: data.frames[time.place], to: data.frames[time.place] };
}

function edit(note) {
  editing = note;
  pen.strokes = note ? structuredClone(note.strokes) : [];
  $("text").value = note ? note.text : "";
  $("add").textContent = note ? "Save" : "Add";
  $("cancel").hidden = !note;
  if (note) {
    go(note);
    $("text").focus();
  }
  refresh();
}

function go(note) {
  stop();
  const place = data.frames.findIndex((number) => number >= note.from && number <= note.to);
  if (place < 0) return say(`This run has no picture of ${places(note)}.`);
  if (!(data.frames[time.place] >= note.from && data.frames[time.place] <= note.to)) seek(place);
}

$("form").addEventListener("submit", (event) => {
  event.preventDefault();
  endStroke();
  const text = $("text").value.trim();
  if (!text && pen.strokes.length === 0) return say("A note needs words or a drawing.");
  const { from, to } = subject();
  const note = { id: editing?.id ?? crypto.randomUUID?.() ?? `${Date.now()}-${Math.random()}`, from, to, text, strokes: pen.strokes, done: editing?.done ?? false, changed: new Date().toISOString() };
  notes = [...notes.filter((n) => n.id !== note.id), note];
  setPen(false);
  edit(null);
  keep();
  $("text").blur();
});
on("cancel", () => { setPen(false); edit(null); });
on("draw", () => setPen(!pen.on));
on("undo", () => { endStroke(); pen.strokes.pop(); showDrawings(); });
for (const [name, color] of COLORS) {
  $("colors").append(element("button", {
    type: "button", role: "radio", "aria-label": name, title: name, "aria-checked": color === pen.color, style: `background: ${color}`,
    onclick: (event) => {
      pen.color = color;
      for (const other of $("colors").children) other.setAttribute("aria-checked", other === event.currentTarget);
      if (!pen.on) setPen(true);
    },
  }));
}

let listed = "";
function showNotes() {
  const { from, to } = subject();
  $("about").textContent = `${editing ? "Change the note on" : "Note on"} ${places({ from, to })}`;
  const number = data.frames[time.place];
  if (listed !== "yes") {
    listed = "yes";
    $("notes").replaceChildren(...notes.map((note) => {
      const words = note.text || "(drawing)";
      const small = (label, name, work) => element("button", { class: "small", "aria-label": `${name} the note on ${places(note)}`, onclick: work }, label);
      const row = element("li", { class: note.done ? "done" : "" },
        element("button", { class: "go", title: "Go there", onclick: () => go(note) }, `${note.from}${note.from === note.to ? "" : `–${note.to}`} · ${timecode(note.from - 1, data.fps)}${note.strokes.length ? " · drawing" : ""}`),
        element("span", {},
          small(note.done ? "Reopen" : "Done", note.done ? "Reopen" : "Close", () => { Object.assign(note, { done: !note.done, changed: new Date().toISOString() }); keep(); }),
          small("Edit", "Edit", () => edit(note)),
          small("Delete", "Delete", () => { if (editing?.id === note.id) edit(null); notes = notes.filter((n) => n.id !== note.id); keep(); say("The note is deleted."); })),
        element("span", { class: "words" }, words));
      row.note = note;
      return row;
    }));
    if (notes.length === 0) $("notes").append(element("li", { class: "none" }, "No notes yet. N writes one, P draws, I and O set a range. They stay in this browser until they are exported."));
  }
  for (const row of $("notes").children) row.classList.toggle("here", row.note !== undefined && number >= row.note.from && number <= row.note.to);
}
