// Opens the pictures of a point: the choice, the truth, the visible difference.
const report = JSON.parse(document.getElementById("data").textContent);
const shown = document.getElementById("shown");

const element = (name, properties = {}, children = []) => {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
};
const short = (v) => (v === null || v === undefined ? "-" : Number(v.toPrecision(3)).toString());

function figure(path, words) {
  const children = [element("figcaption", { textContent: words })];
  if (path) children.unshift(element("img", { src: path, alt: words, loading: "lazy" }));
  else children.unshift(element("p", { textContent: "No picture was kept: draw the chart with --output." }));
  return element("figure", {}, children);
}

function row(group, choice, s) {
  const point = choice.points[s];
  const scene = report.scenes[s];
  const light = point.error.relativeRmseToSurface;
  const numbers = [
    point.frame && `${short(point.frame.median)} ms (${short(point.frame.p10)} to ${short(point.frame.p90)})`,
    light !== null && light !== undefined && `relative RMSE ${short(light)}`,
    `FLIP ${short(point.error.flipMean)}, 99 % ${short(point.error.flip99)}`,
  ].filter(Boolean).join(", ");
  const title = element("h3", { textContent: `${scene.name}: ${numbers}` });
  const why = element("p", { textContent: scene.provokes });
  const pictures = element("div", { className: "row" }, [
    figure(point.picture, choice.name),
    figure(group.truthPictures[s], `right: ${group.truth}`),
    figure(point.difference, "visible difference"),
  ]);
  return [title, why, pictures];
}

function open(address) {
  const [g, c, s] = address.split(" ").map(Number);
  const group = report.groups[g];
  const choice = group.choices[c];
  const close = element("button", { textContent: "Close", onclick: () => shown.close() });
  const head = element("div", { className: "bar" }, [element("h2", { textContent: `${group.flag}: ${choice.name}` }), close]);
  const scenes = s === undefined ? report.scenes.keys() : [s];
  shown.replaceChildren(head, ...[...scenes].flatMap((s) => row(group, choice, s)));
  shown.showModal();
  shown.scrollTop = 0;
}

for (const dot of document.querySelectorAll(".dot")) {
  dot.addEventListener("click", () => open(dot.dataset.opens));
  dot.addEventListener("keydown", (e) => {
    if (e.key === "Enter" || e.key === " ") { e.preventDefault(); open(dot.dataset.opens); }
  });
}
shown.addEventListener("click", (e) => { if (e.target === shown) shown.close(); });
