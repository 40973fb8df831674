"use strict";
// Draws a situation (map, graph, start) and an answer (ways, front, certificate); asks the server, where there is one.
const data = JSON.parse(document.getElementById("data").textContent);
const { situation, live, token } = data;
const find = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";
let answer = data.answer;
let chosen = null; // index of a way
let peeked = null; // index of the way under the pointer
let goal = null; // [x, y], metres
let asking = null; // of the question that is being answered

function made(name, attributes = {}, parent = null, text = null) {
  const element = name.startsWith("svg:") ? document.createElementNS(SVG, name.slice(4)) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== null) element.textContent = text;
  parent?.append(element);
  return element;
}

// ---------------------------------------------------------------- the map

const map = find("map"), ground = find("ground"), drawn = find("drawn");
const layers = made("svg:g", {}, drawn), marks = made("svg:g", {}, drawn);
const view = { x: 0, y: 0, scale: 1, width: 1, height: 1 };
const shapes = groundShapes();

function groundShapes() {
  const free = new Path2D(), odometry = new Path2D(), closures = new Path2D();
  for (const ring of situation.free) {
    ring.forEach(([x, y], place) => (place ? free.lineTo(x, y) : free.moveTo(x, y)));
    free.closePath();
  }
  for (const [edges, path] of [[situation.odometry, odometry], [situation.closures, closures]])
    for (const [from, to] of edges) {
      path.moveTo(...situation.poses[from]);
      path.lineTo(...situation.poses[to]);
    }
  return { free, odometry, closures };
}

const onScreen = ([x, y]) => [view.width / 2 + (x - view.x) * view.scale, view.height / 2 - (y - view.y) * view.scale];
const inWorld = (u, v) => [view.x + (u - view.width / 2) / view.scale, view.y - (v - view.height / 2) / view.scale];

function showAll() {
  const [left, low, right, high] = situation.extent;
  view.x = (left + right) / 2;
  view.y = (low + high) / 2;
  view.scale = 0.94 * Math.min(view.width / Math.max(right - left, 1e-3), view.height / Math.max(high - low, 1e-3));
}

function zoom(factor, u = view.width / 2, v = view.height / 2) {
  const [x, y] = inWorld(u, v);
  view.scale = Math.min(Math.max(view.scale * factor, 1e-3), 1e5);
  view.x = x - (u - view.width / 2) / view.scale;
  view.y = y + (v - view.height / 2) / view.scale;
  render();
}

function resize() {
  const first = view.width <= 1, { width, height } = map.getBoundingClientRect();
  Object.assign(view, { width, height });
  ground.width = Math.round(width * devicePixelRatio);
  ground.height = Math.round(height * devicePixelRatio);
  drawn.setAttribute("viewBox", `0 0 ${width} ${height}`);
  if (first) showAll();
  render();
}

function render() {
  const pen = ground.getContext("2d"), style = getComputedStyle(document.documentElement), k = view.scale, dpr = devicePixelRatio;
  const colour = (name) => style.getPropertyValue(`--${name}`);
  const [u, v] = onScreen([0, 0]);
  pen.setTransform(1, 0, 0, 1, 0, 0);
  pen.clearRect(0, 0, ground.width, ground.height);
  pen.setTransform(k * dpr, 0, 0, -k * dpr, u * dpr, v * dpr);
  pen.fillStyle = colour("free");
  pen.fill(shapes.free, "evenodd");
  const thin = Math.min(1.4, Math.max(0.4, 2 - 0.35 * Math.log10(1 + situation.poses.length)));
  for (const [path, name, width] of [
    [shapes.free, "wall", 1], [shapes.closures, "closure", 0.9 * thin], [shapes.odometry, "odometry", 1.2 * thin],
  ]) {
    pen.strokeStyle = colour(name);
    pen.lineWidth = width / k;
    pen.stroke(path);
  }
  layers.setAttribute("transform", `matrix(${k} 0 0 ${-k} ${u} ${v})`);
  marks.replaceChildren();
  const [x, y] = onScreen(situation.start);
  made("svg:circle", { class: "start", cx: x, cy: y, r: 6 }, marks);
  if (goal) {
    const [gx, gy] = onScreen(goal), corners = [];
    for (let corner = 0; corner < 10; corner++) {
      const radius = corner % 2 ? 4 : 10, angle = (Math.PI * corner) / 5 - Math.PI / 2;
      corners.push(`${gx + radius * Math.cos(angle)},${gy + radius * Math.sin(angle)}`);
    }
    made("svg:polygon", { class: "goal", points: corners.join(" ") }, marks);
  }
}

const outline = (points) => "M" + points.map((point) => point.join(" ")).join("L");

function drawWays() {
  layers.replaceChildren();
  if (!answer?.ways) return;
  const fixed = { "vector-effect": "non-scaling-stroke" };
  const top = peeked ?? chosen, shown = answer.ways[top];
  if (shown) {
    const seen = shown.seen.map((pose, place) =>
      (place && shown.seen[place - 1] === pose - 1 ? "L" : "M") + situation.poses[pose].join(" ") + "h0").join("");
    if (seen) made("svg:path", { class: "seen", d: seen, ...fixed }, layers);
    const links = shown.links.map(([x, y, u, v]) => `M${x} ${y}L${u} ${v}`).join("");
    if (links) made("svg:path", { class: "links", d: links, ...fixed }, layers);
  }
  const order = answer.ways.map((way, index) => index).sort((a, b) => (a === top) - (b === top));
  for (const index of order) {
    const way = answer.ways[index], name = `way ${way.standing}${index === top ? " chosen" : ""}`;
    made("svg:path", { class: name, d: outline(way.path), ...fixed }, layers);
    const grip = made("svg:path", { class: "grip", d: outline(way.path), "data-way": index, ...fixed }, layers);
    made("svg:title", {}, grip, way.name);
  }
}

const pointers = new Map();
let pressed = null; // where, and whether it has moved since

map.addEventListener("pointerdown", (event) => {
  if (event.target.closest("button")) return;
  map.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, [event.clientX, event.clientY]);
  pressed = { x: event.clientX, y: event.clientY, moved: pointers.size > 1, way: event.target.dataset?.way };
});
map.addEventListener("pointermove", (event) => {
  const before = pointers.get(event.pointerId);
  if (!before) {
    const way = event.target.dataset?.way;
    return peek(way === undefined ? null : Number(way));
  }
  const others = [...pointers.entries()].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
  const now = [event.clientX, event.clientY];
  if (Math.hypot(now[0] - pressed.x, now[1] - pressed.y) > 5) pressed.moved = true;
  if (pressed.moved && !others.length) {
    view.x -= (now[0] - before[0]) / view.scale;
    view.y += (now[1] - before[1]) / view.scale;
    map.classList.add("moving");
    render();
  } else if (others.length) {
    const box = map.getBoundingClientRect(), [other] = others;
    const apart = (place) => Math.hypot(place[0] - other[0], place[1] - other[1]);
    zoom(apart(now) / Math.max(apart(before), 1), (now[0] + other[0]) / 2 - box.left, (now[1] + other[1]) / 2 - box.top);
  }
  pointers.set(event.pointerId, now);
});
for (const name of ["pointerup", "pointercancel"])
  map.addEventListener(name, (event) => {
    if (!pointers.delete(event.pointerId)) return;
    map.classList.remove("moving");
    if (name === "pointercancel" || !pressed || pressed.moved || pointers.size) return;
    if (pressed.way !== undefined) return choose(Number(pressed.way));
    const box = map.getBoundingClientRect();
    if (live) setGoal(inWorld(event.clientX - box.left, event.clientY - box.top));
  });
map.addEventListener("pointerleave", () => peek(null));
map.addEventListener("wheel", (event) => {
  event.preventDefault();
  const box = map.getBoundingClientRect();
  zoom(Math.exp(-event.deltaY / 400), event.clientX - box.left, event.clientY - box.top);
}, { passive: false });
find("closer").addEventListener("click", () => zoom(1.5));
find("farther").addEventListener("click", () => zoom(1 / 1.5));
find("whole").addEventListener("click", () => { showAll(); render(); });

// ---------------------------------------------------------------- the answer

function show(next) {
  const path = chosen === null || !answer?.ways ? null : answer.ways[chosen]?.path;
  const wasBest = chosen === null || chosen === answer?.best;
  const shownBefore = JSON.stringify(path);
  answer = next;
  const kept = wasBest ? -1 : (answer.ways ?? []).findIndex((way) => JSON.stringify(way.path) === shownBefore);
  find("state").textContent = answer.error ?? answer.progress;
  find("state").classList.toggle("failed", Boolean(answer.error));
  find("stop").hidden = answer.state !== "working";
  if (!answer.ways) {
    if (answer.error) empty();
    return;
  }
  find("headline").textContent = answer.headline;
  find("certificate").textContent = answer.certificate;
  find("notes").replaceChildren(...answer.notes.map((note) => made("li", {}, null, note)));
  find("ways").hidden = false;
  listWays();
  choose(kept >= 0 ? kept : answer.best);
}

function empty() {
  for (const id of ["ways", "front"]) find(id).hidden = true;
  for (const id of ["certificate", "notes"]) find(id).replaceChildren();
  find("headline").textContent = data.first;
  layers.replaceChildren();
}

function listWays() {
  const held = find("list").contains(document.activeElement);
  const rows = answer.ways.map((way, index) => {
    const row = made("label", { class: way.standing });
    made("input", { type: "radio", name: "way", value: index }, row).addEventListener("change", () => choose(index));
    made("span", {}, row, `${way.name}, ${way.length.toFixed(1)} m, ${way.closures}`);
    made("span", { class: "value" }, row, way.value ?? "");
    row.addEventListener("pointerenter", () => peek(index));
    row.addEventListener("pointerleave", () => peek(null));
    return row;
  });
  find("list").replaceChildren(...rows);
  if (held) find("list").querySelector(`input[value="${Math.max(0, chosen)}"]`)?.focus();
}

function peek(index) {
  if (!answer?.ways || index === peeked) return;
  peeked = answer.ways[index] ? index : null;
  find("why").textContent = answer.ways[peeked ?? chosen].why;
  drawWays();
}

function choose(index) {
  if (!answer?.ways?.[index]) return;
  chosen = index;
  peeked = null;
  find("list").querySelectorAll("label").forEach((row, place) => {
    row.classList.toggle("chosen", place === index);
    row.querySelector("input").checked = place === index;
  });
  find("why").textContent = answer.ways[index].why;
  drawWays();
  drawFront();
}

function drawFront() {
  const { front, front_bounds: bounds } = answer, curve = find("curve");
  find("front").hidden = front.length < 2;
  if (front.length < 2) return;
  const [width, height, left, right, top, low] = [360, 150, 58, 10, 8, 24];
  const values = [...front.map((point) => point.value), ...bounds.map((point) => point.value)];
  const metres = [...front.map((point) => point.metres), answer.limit];
  const [x0, x1, y0, y1] = [Math.min(...metres), Math.max(...metres), Math.min(...values), Math.max(...values)];
  const x = (value) => left + ((value - x0) / Math.max(x1 - x0, 1e-9)) * (width - left - right);
  const y = (value) => height - low - ((value - y0) / Math.max(y1 - y0, 1e-12)) * (height - low - top);
  const steps = (points) => points.map((point, place) => (place ? `H${x(point.metres)}V` : `M${x(point.metres)} `) +
    y(point.value)).join("") + `H${x(answer.limit)}`;
  const stepsBack = (points) => points.map((point, place) => (place ? `V${y(point.value)}H${x(point.metres)}` :
    `M${x(point.metres)} ${y(point.value)}`)).join("");
  const shown = (value) => `${(value * answer.scale).toFixed(2)} ${answer.unit}`;
  curve.setAttribute("viewBox", `0 0 ${width} ${height}`);
  curve.replaceChildren();
  made("svg:path", { class: "axis", d: `M${left} ${top}V${height - low}H${width - right}` }, curve);
  for (const value of [y0, y1]) made("svg:text", { x: left - 4, y: y(value) + 4, "text-anchor": "end" }, curve, shown(value));
  for (const value of [x0, x1])
    made("svg:text", { x: x(value), y: height - 8, "text-anchor": value === x0 ? "start" : "end" }, curve, `${value.toFixed(1)} m`);
  if (bounds.length) made("svg:path", { class: "bound", d: stepsBack(bounds) }, curve);
  made("svg:path", { class: "steps", d: steps(front) }, curve);
  const place = front.findIndex((point) => point.way === chosen), slider = find("slider");
  slider.max = front.length - 1;
  if (place >= 0) {
    made("svg:circle", { cx: x(front[place].metres), cy: y(front[place].value), r: 5 }, curve);
    slider.value = place;
    find("metres").textContent = `${front[place].metres.toFixed(1)} m`;
    slider.setAttribute("aria-valuetext", `${front[place].metres.toFixed(1)} m, ${answer.ways[chosen].value}`);
  } else find("metres").textContent = "";
}

find("slider").addEventListener("input", () => choose(answer.front[Number(find("slider").value)].way));

// ---------------------------------------------------------------- questions

const aim = () => document.querySelector("input[name=aim]:checked").value;

function setGoal([x, y]) {
  document.querySelector("input[name=aim][value=goal]").checked = true;
  find("goal-x").value = x.toFixed(2);
  find("goal-y").value = y.toFixed(2);
  find("limit").value = "";
  ask();
}

function question() {
  const number = (id) => (find(id).value === "" ? null : Number(find(id).value));
  return {
    goal: aim() === "goal" ? [number("goal-x"), number("goal-y")] : null,
    return: aim() === "return",
    max_length: number("limit"),
    objective: find("objective").value,
    closures: find("closures").value,
    candidates: Number(find("compare").value),
    bounds: find("bounds").value,
  };
}

async function call(path, options = {}) {
  const response = await fetch(path, { ...options, headers: { "Content-Type": "application/json", Authorization: `Bearer ${token}` } });
  if (!response.ok) throw new Error((await response.json()).error);
  return response;
}

async function ask() {
  const asked = question();
  if (asked.goal?.includes(null)) return failed("Say where the goal is: click the map, or fill in x and y.");
  if (!asked.goal && asked.max_length === null) asked.max_length = Number((find("limit").value = situation.max_length));
  goal = asked.goal;
  render();
  const mine = (asking = { id: null });
  find("state").classList.remove("failed");
  find("state").textContent = "asked …";
  try {
    let next = await (await call("/questions", { method: "POST", body: JSON.stringify(asked) })).json();
    mine.id = next.id;
    chosen = null;
    while (asking === mine) {
      show(next);
      if (next.state !== "working") return;
      next = await (await call(`/answers/${next.id}?after=${next.version}`)).json();
    }
    await call(`/answers/${mine.id}/stop`, { method: "POST", body: "{}" });
  } catch (error) {
    if (asking === mine) failed(error instanceof TypeError ? "The server does not answer any more; start it again." : error.message);
  }
}

function failed(message) {
  find("stop").hidden = true;
  find("state").textContent = message;
  find("state").classList.add("failed");
}

function download(content, name) {
  const url = URL.createObjectURL(content);
  made("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

for (const button of document.querySelectorAll("[data-format]"))
  button.addEventListener("click", () => {
    const way = answer.ways[chosen], suffix = button.dataset.format;
    download(new Blob([way.files[suffix]]), `${way.name.replace(/[^\w]+/g, "_")}.${suffix}`);
  });
find("save").addEventListener("click", async () => {
  try {
    download(await (await call(`/answers/${asking.id}/page`)).blob(), "decision.html");
  } catch (error) {
    failed(error.message);
  }
});
find("stop").addEventListener("click", () => asking?.id && call(`/answers/${asking.id}/stop`, { method: "POST", body: "{}" }));
find("question").addEventListener("submit", (event) => { event.preventDefault(); ask(); });
for (const id of ["objective", "closures", "compare", "bounds"])
  find(id).addEventListener("change", () => {
    find("bounds-row").hidden = find("compare").value === "0";
    if (answer) ask();
  });

function options(id, entries) {
  for (const [value, text] of entries) made("option", { value }, find(id), text);
}

options("objective", situation.objectives);
options("closures", situation.closure_models);
options("compare", situation.comparisons);
options("bounds", situation.bounds);
for (const [name, text] of [
  ["odometry", "odometry"], ["closure", "loop closures"], ["best", "the best way"], ["possible", "may still be the best"],
  ["ruled", "other ways"], ["seen", "seen again"], ["link", "predicted closures"],
]) {
  const entry = made("li", {}, find("key"));
  made("i", {}, entry).style.color = `var(--${name})`;
  entry.append(text);
}
if (!live) {
  find("question").querySelectorAll("input, select, button").forEach((control) => { control.disabled = true; });
  find("save").hidden = true;
  find("state").textContent = "Saved with its decision; topobelief serve answers further questions.";
}
new ResizeObserver(resize).observe(map);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", render);
if (answer) {
  goal = answer.question.goal;
  const asked = answer.question;
  document.querySelector(`input[name=aim][value=${asked.goal ? "goal" : asked.return ? "return" : "trip"}]`).checked = true;
  if (asked.goal) [find("goal-x").value, find("goal-y").value] = asked.goal;
  if (asked.max_length !== null) find("limit").value = asked.max_length;
  for (const [id, key] of [["objective", "objective"], ["closures", "closures"], ["compare", "candidates"], ["bounds", "bounds"]])
    find(id).value = asked[key];
  find("bounds-row").hidden = find("compare").value === "0";
  show(answer);
}
