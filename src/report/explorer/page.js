"use strict";
(() => {
/** The model, in a thread of its own: requests in JSON come as messages, answers go back the same way. */
function engine(port) {
  let made = null;
  const write = new TextEncoder(), read = new TextDecoder();
  const start = async (base64) => {
    const packed = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    made = (await WebAssembly.instantiate(await new Response(stream).arrayBuffer(), {})).instance.exports;
    return "{}";
  };
  const answer = (request) => {
    const text = write.encode(request);
    const at = made.room(text.length);
    new Uint8Array(made.memory.buffer, at, text.length).set(text);
    const length = made.answer();
    return read.decode(new Uint8Array(made.memory.buffer, made.answered(), length));
  };
  port.onmessage = async ({ data }) => {
    let text;
    try {
      text = data.module ? await start(data.module) : answer(data.request);
    } catch (error) {
      text = JSON.stringify({ error: `the model stopped: ${error.message}; load this page again` });
    }
    port.postMessage({ id: data.id, text });
  };
}

const $ = (id) => document.getElementById(id);
const held = JSON.parse($("data").textContent);
const waiting = new Map();
let lastId = 0, send = null;

function received({ data }) {
  const { resolve, reject } = waiting.get(data.id);
  waiting.delete(data.id);
  const answer = JSON.parse(data.text);
  if (answer.error) reject(new Error(answer.error)); else resolve(answer);
}

function post(message) {
  return new Promise((resolve, reject) => {
    const id = ++lastId;
    waiting.set(id, { resolve, reject });
    send({ id, ...message });
  });
}

/** @param {object} request @returns {Promise<any>} */
const ask = (request) => post({ request: JSON.stringify(request) });

/** In this thread, where a browser starts no other from a file. */
function inThisThread() {
  const port = { onmessage: null, postMessage: (data) => received({ data }) };
  engine(port);
  send = (message) => setTimeout(() => port.onmessage({ data: message }));
}

async function startEngine() {
  const module = $("module").textContent;
  try {
    const url = URL.createObjectURL(new Blob([`(${engine})(self)`], { type: "text/javascript" }));
    const worker = new Worker(url);
    const failed = new Promise((_, reject) => { worker.onerror = () => reject(new Error("no thread")); });
    worker.onmessage = received;
    send = (message) => worker.postMessage(message);
    await Promise.race([post({ module }), failed]);
  } catch (error) {
    if (/the model stopped/.test(error.message)) throw error;
    waiting.clear();
    inThisThread();
    await post({ module });
  }
}

// What is looked at.
const state = { name: "", own: "", segments: [], past: [], future: [], shown: [], kept: null, set: {}, open: null, series: null, moment: null,
  profile: "", time: 0, follows: true, hidden: new Set(), hint: null, picked: null };

const element = (tag, properties, ...children) => {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(properties || {})) {
    if (key in made) made[key] = value; else made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
};
const drawn = (tag, attributes, text) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
};
const unseen = (words) => element("span", { className: "unseen", textContent: words });
const same = (a, b) => a.length === b.length && a.every((v, i) => v === b[i]);
/** Three or four digits, whatever the size. */
const digits = (v, n = 4) => {
  if (v === 0) return "0";
  const size = Math.abs(v);
  return size >= 1e5 || size < 1e-3 ? v.toExponential(n - 1) : String(Number(v.toPrecision(n)));
};
const say = (words) => { $("said").textContent = words; };
const fail = (error) => { $("fault").textContent = error.message; $("fault").hidden = false; };
const half = (segment) => (2 * segment <= state.segments.length ? "A" : "B");

// The layers.
function makeLayers() {
  const list = $("layers");
  list.replaceChildren();
  const count = state.segments.length;
  for (let layer = count; layer >= 1; layer--) {
    const button = element("button", { type: "button", className: "layer", tabIndex: layer === count ? 0 : -1 },
      element("span", { className: "grip", ariaHidden: "true" }, "⠿"), element("span", { className: "number" }, unseen("layer "), String(layer)),
      element("span", { className: "band" }, unseen(", segment "), document.createTextNode("")), element("span", { className: "share" }, element("i"), unseen("")),
      element("span", { className: "heat" }));
    button.dataset.layer = String(layer);
    button.setAttribute("aria-describedby", "how");
    list.append(element("li", {}, button));
  }
}
const buttonOf = (layer) => $("layers").children[state.segments.length - layer].firstChild;

function showLayers() {
  const count = state.segments.length, now = state.moment;
  const shares = now && now.shares_deg_per_h;
  const most = shares ? Math.max(...shares.map(Math.abs), 1e-300) : 1;
  const warm = now ? [Math.min(...now.temperatures_c), Math.max(...now.temperatures_c)] : [0, 0];
  for (let layer = 1; layer <= count; layer++) {
    const button = buttonOf(layer), segment = state.segments[layer - 1];
    const [, , band, share, heat] = button.children;
    band.lastChild.data = `${segment} ${half(segment)}`;
    // Blue at one end of the fibre, orange at the other, grey in the middle.
    const along = (2 * segment - 1 - count) / count;
    band.style.background = `hsl(${along < 0 ? 210 : 30} ${Math.round(25 + 60 * Math.abs(along))}% 84%)`;
    const value = shares ? shares[layer - 1] : 0;
    share.firstChild.style.width = `${50 * Math.abs(value) / most}%`;
    share.firstChild.style.left = value < 0 ? `${50 - 50 * Math.abs(value) / most}%` : "50%";
    share.classList.toggle("less", value < 0);
    heat.textContent = now ? `${now.temperatures_c[layer - 1].toFixed(3)} °C` : "";
    const place = now && warm[1] > warm[0] ? (now.temperatures_c[layer - 1] - warm[0]) / (warm[1] - warm[0]) : 0;
    heat.style.setProperty("--warm", `${Math.round(60 * place)}%`);
    share.lastChild.textContent = shares ? `, adds ${digits(value)} degrees per hour, ` : ", ";
    button.setAttribute("aria-pressed", String(state.picked === layer));
    button.classList.toggle("picked", state.picked === layer);
  }
}

/** The segments with one layer moved: the others shift, or the two change places. */
function moved(segments, from, to) {
  const next = segments.slice();
  if ($("way").value === "exchange") {
    [next[from - 1], next[to - 1]] = [next[to - 1], next[from - 1]];
  } else {
    next.splice(to - 1, 0, ...next.splice(from - 1, 1));
  }
  return next;
}

function set(segments, name, remember = true) {
  if (same(segments, state.segments) && (!name || name === state.name)) return;
  if (remember) {
    state.past.push({ name: state.name, segments: state.segments });
    state.future = [];
  }
  const known = state.shown.find((other) => same(other.segments, segments));
  state.name = name || (known ? known.name : state.own || "mine");
  state.segments = segments;
  changed();
}

function changed() {
  state.hint = null;
  $("hinted").hidden = true;
  $("typed").value = state.segments.join(" ");
  $("typed").removeAttribute("aria-invalid");
  $("wrong").textContent = "";
  $("name").value = state.name;
  $("undo").disabled = state.past.length === 0;
  $("redo").disabled = state.future.length === 0;
  showLayers();
  refresh();
}

function step(from, to) {
  const last = from.pop();
  if (!last) return;
  to.push({ name: state.name, segments: state.segments });
  Object.assign(state, last);
  changed();
}

// What the model says of it.
let busy = false, again = false;
async function refresh() {
  again = true;
  if (busy) return;
  busy = true;
  document.body.dataset.busy = "yes";
  try {
    while (again) {
      again = false;
      await judge();
    }
    $("fault").hidden = true;
  } catch (error) {
    fail(error);
  } finally {
    busy = false;
    delete document.body.dataset.busy;
  }
}

async function judge() {
  const { name, segments } = state, begun = performance.now();
  if (!state.judged) {
    const first = await ask({ ask: "worst", segments });
    $("worst").textContent = first.shown;
    document.body.dataset.firstMs = String(Math.round(performance.now() - opened));
  }
  state.judged = await ask({ ask: "judge", name, segments });
  document.body.dataset.changeMs = String(Math.round(performance.now() - begun));
  showNumbers();
  if (again) return;
  for (const other of state.shown.concat(state.kept || [])) {
    if (!other.judged) other.judged = await ask({ ask: "judge", name: other.name, segments: other.segments });
  }
  showTable();
  if (state.follows) {
    state.profile = state.judged.pattern.worst_profile;
    state.time = state.judged.pattern.worst_time_s;
    $("profile").value = state.profile;
  }
  await overTime();
}

async function overTime() {
  const others = compared();
  state.series = await ask({ ask: "series", profile: state.profile, patterns: [state.segments, ...others.map((o) => o.segments)] });
  state.series.names = ["this winding", ...others.map((o) => o.name)];
  const { times_s } = state.series;
  state.time = Math.min(state.time, times_s[times_s.length - 1]);
  $("time").max = String(times_s[times_s.length - 1]);
  await atTime();
}

async function atTime() {
  $("time").value = String(state.time);
  state.moment = await ask({ ask: "moment", profile: state.profile, time_s: Math.max(0, state.time), segments: state.segments });
  $("time").setAttribute("aria-valuetext", `${digits(state.time / 60)} minutes`);
  $("moment").textContent = `${digits(state.time / 60)} min: the drive is at ${state.moment.boundary_c.toFixed(3)} °C`;
  showLayers();
  drawRates();
}

const compared = () => state.shown.concat(state.kept || []).filter((o) => !same(o.segments, state.segments));
const reference = () => state.shown.find((o) => o.name === "qua" && o.judged) || state.shown.find((o) => o.judged);

function showNumbers() {
  const { pattern, cells, hard_because } = state.judged;
  const { windability } = pattern;
  $("worst").textContent = cells[1];
  $("guaranteed").textContent = cells[2];
  $("class").textContent = cells[8];
  $("reels").textContent = cells[9];
  $("captive").textContent = String(windability.captive);
  $("climb").textContent = cells[10];
  $("hard").textContent = hard_because ? `Hard to make: ${hard_because}.` : "It can be wound without a captive run.";
  verdict();
  say(`worst rate error ${cells[1]} degrees per hour`);
}

function verdict() {
  const by = reference(), worst = state.judged.pattern.worst_rate_deg_per_h;
  let words = `Under these profiles the rate error of this winding is at worst ${state.judged.cells[1]} °/h`;
  if (by && !same(by.segments, state.segments)) {
    const times = by.judged.pattern.worst_rate_deg_per_h / worst;
    words += times >= 1 ? `: ${digits(times, 3)} times smaller than with ${by.name}` : `: ${digits(1 / times, 3)} times larger than with ${by.name}`;
  }
  $("verdict").textContent = words + ".";
}

function showTable() {
  verdict();
  const rows = [{ name: state.name, segments: state.segments, judged: state.judged, now: true }, ...compared()];
  $("rows").replaceChildren(...rows.map((row) => {
    const line = element("tr", { className: row.now ? "best" : "" });
    row.judged.cells.forEach((cell, i) => {
      const words = i === 0 ? (row.now ? `this: ${row.name}` : row.name) : cell;
      const one = element(i === 0 ? "th" : "td", { textContent: words, className: i === 0 || i === 6 ? "word" : "" });
      if (i === 0) one.scope = "row";
      if (row.now) one.dataset.cell = String(i);
      line.append(one);
    });
    line.append(element("td", { textContent: String(row.judged.pattern.windability.captive) }));
    const last = element("td", {});
    if (!row.now) last.append(element("button", { type: "button", textContent: "take", ariaLabel: `take ${row.name}`, onclick: () => set(row.segments, row.name) }));
    line.append(last);
    return line;
  }));
  document.body.dataset.shown = state.segments.join(" ");
}

// Rate errors over time.
const LINES = ["var(--s0)", "var(--s1)", "var(--s2)", "var(--s3)"];
let view = null;

function ticks(from, to, most) {
  const rough = (to - from) / most, power = 10 ** Math.floor(Math.log10(rough));
  const pace = [1, 2, 5, 10].map((f) => f * power).find((p) => p >= rough) || 10 * power;
  const found = [];
  for (let v = Math.ceil(from / pace) * pace; v <= to + 1e-9 * pace; v += pace) found.push(Math.abs(v) < 1e-9 * pace ? 0 : v);
  return found;
}

function drawRates() {
  const { series } = state;
  if (!series) return;
  const svg = $("rates"), width = Math.max(280, svg.parentElement.clientWidth), height = 300;
  const box = { left: 62, right: width - 16, top: 10, bottom: height - 40 };
  const minutes = series.times_s.map((t) => t / 60), end = minutes[minutes.length - 1];
  const range = state.zoom || [0, end];
  const log = $("scale").value === "log";
  const lines = series.rates_deg_per_h.map((values, i) => ({ values, name: series.names[i], colour: LINES[i % LINES.length] }))
    .filter((line) => !state.hidden.has(line.name));
  const inside = (values) => values.filter((_, i) => minutes[i] >= range[0] && minutes[i] <= range[1]).map(Math.abs);
  const tops = lines.map((line) => Math.max(0, ...inside(line.values)));
  const top = Math.max(...tops, 1e-12);
  // Two decades below the best winding's largest are enough to read it.
  const least = Math.max(1e-9 * top, Math.min(...tops.filter((t) => t > 0), top) / 100);
  const low = log ? Math.floor(Math.log10(least)) : -top, high = log ? Math.log10(top * 1.3) : top;
  const x = (m) => box.left + (m - range[0]) / (range[1] - range[0]) * (box.right - box.left);
  const y = (v) => {
    const placed = log ? Math.log10(Math.max(Math.abs(v), 10 ** low)) : v;
    return box.bottom - (placed - low) / (high - low) * (box.bottom - box.top);
  };
  const parts = [];
  for (const m of ticks(range[0], range[1], width < 500 ? 4 : 8)) {
    parts.push(drawn("line", { x1: x(m), x2: x(m), y1: box.top, y2: box.bottom, class: "grid" }),
      drawn("text", { x: x(m), y: box.bottom + 16, "text-anchor": "middle" }, digits(m)));
  }
  const levels = log ? ticks(low, high, 6).filter((v) => Number.isInteger(v)) : ticks(low, high, 6);
  for (const v of levels) {
    const level = box.bottom - (v - low) / (high - low) * (box.bottom - box.top);
    parts.push(drawn("line", { x1: box.left, x2: box.right, y1: level, y2: level, class: "grid" }),
      drawn("text", { x: box.left - 6, y: level + 4, "text-anchor": "end" }, log ? digits(10 ** v) : digits(v, 3)));
  }
  parts.push(drawn("text", { x: (box.left + box.right) / 2, y: height - 6, "text-anchor": "middle" }, "time [min]"),
    drawn("text", { transform: `translate(13 ${(box.top + box.bottom) / 2}) rotate(-90)`, "text-anchor": "middle" }, log ? "|rate error| [°/h]" : "rate error [°/h]"));
  for (const line of lines.slice().reverse()) {
    let path = "", drawing = false;
    line.values.forEach((v, i) => {
      const visible = minutes[i] >= range[0] && minutes[i] <= range[1];
      if (visible) path += `${drawing ? "L" : "M"}${x(minutes[i]).toFixed(1)} ${y(v).toFixed(1)}`;
      drawing = visible;
    });
    parts.push(drawn("path", { d: path, stroke: line.colour, class: line.name === "this winding" ? "line now" : "line" }));
  }
  const at = x(state.time / 60);
  if (at >= box.left && at <= box.right) parts.push(drawn("line", { x1: at, x2: at, y1: box.top, y2: box.bottom, class: "cursor" }));
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.style.height = `${height}px`;
  svg.replaceChildren(...parts);
  view = { box, range, minutes };
  legend();
}

function legend() {
  const { series } = state;
  let row = 0;
  // At a kink both sides have the same time; the later one is what the scrubber means.
  const here = Math.max(0, series.times_s.findLastIndex((t) => t <= state.time));
  $("legend").replaceChildren(...series.names.map((name) => {
    const index = row++, value = series.rates_deg_per_h[index][here];
    const button = element("button", { type: "button", onclick: () => {
      if (!state.hidden.delete(name)) state.hidden.add(name);
      drawRates();
    } }, element("i"), `${name} ${digits(value)} °/h`);
    button.firstChild.style.background = LINES[index % LINES.length];
    button.setAttribute("aria-pressed", String(!state.hidden.has(name)));
    return button;
  }));
}

function timeUnder(event) {
  const svg = $("rates"), rect = svg.getBoundingClientRect(), { box, range } = view;
  const share = (event.clientX - rect.left - box.left) / (box.right - box.left);
  return range[0] + Math.min(1, Math.max(0, share)) * (range[1] - range[0]);
}

// The model's numbers.
const KNOBS = [
  { key: "film_w_per_m2_k", words: "air film at the outside", unit: "W/(m²K)", low: 0.5, high: 5000, surface: true },
  { key: "diffusivity_m2_per_s", words: "diffusivity of the pack", unit: "m²/s", low: 1e-8, high: 1e-5 },
  { key: "max_rate_c_per_h", words: "steepest ramp", unit: "°C/h", low: 0.1, high: 3600 },
  { key: "spool_j_per_m2_k", words: "heat capacity of the spool", unit: "J/(m²K)", low: 10, high: 1e6, surface: true },
];

function makeKnobs() {
  $("knobs").replaceChildren(...KNOBS.filter((k) => !k.surface || state.open.has_surfaces).map((knob) => {
    const value = state.open.settings[knob.key];
    const place = (v) => Math.round(1000 * Math.log(v / knob.low) / Math.log(knob.high / knob.low));
    const range = element("input", { type: "range", min: "0", max: "1000", value: String(place(value || knob.low)), ariaLabel: `${knob.words}, ${knob.unit}` });
    const number = element("input", { type: "number", step: "any", min: "0", value: value === null ? "" : String(Number(value.toPrecision(4))), placeholder: "none", ariaLabel: `${knob.words}, typed, ${knob.unit}` });
    const turn = (v) => { state.set = { ...state.set, [knob.key]: v }; reopen(); };
    range.setAttribute("aria-valuetext", value === null ? "not in the model" : `${digits(value)} ${knob.unit}`);
    range.oninput = () => { number.value = String(Number((knob.low * (knob.high / knob.low) ** (Number(range.value) / 1000)).toPrecision(3))); };
    range.onchange = () => turn(Number(number.value));
    number.onchange = () => { if (Number(number.value) > 0) turn(Number(number.value)); };
    return element("div", { className: "knob" }, element("span", {}, knob.words), range, number, element("span", {}, knob.unit));
  }));
  $("reset").disabled = Object.keys(state.set).length === 0;
}

let opened = performance.now();
async function reopen() {
  try {
    const before = state.open;
    document.body.dataset.busy = "yes";
    state.open = await ask({ ask: "open", file: held.file, source: held.source, settings: state.set });
    for (const other of state.shown.concat(state.kept || [])) other.judged = null;
    if (!before) begin(); else state.judged = null;
    opened = before ? performance.now() : opened;
    makeKnobs();
    const chosen = state.open.profiles.map((p) => element("option", { value: p.name, textContent: p.name }));
    $("profile").replaceChildren(...chosen);
    $("profile").value = state.profile;
    $("notes").replaceChildren(...state.open.notes.map((note) => element("li", { textContent: note })));
    $("fault").hidden = true;
    await refresh();
  } catch (error) {
    delete document.body.dataset.busy;
    fail(error);
  }
}

function begin() {
  const { classics, columns } = state.open;
  const given = held.patterns.map((p) => ({ ...p }));
  const qua = classics.find((c) => c.name === "qua") || classics[0];
  state.shown = given.slice();
  if (!given.some((p) => same(p.segments, qua.segments))) state.shown.push({ ...qua });
  const first = given[0] || qua;
  Object.assign(state, { name: first.name, segments: first.segments.slice() });
  const all = given.concat(classics.filter((c) => !given.some((p) => p.name === c.name)));
  $("start").replaceChildren(element("option", { value: "", textContent: "choose a winding" }),
    ...all.map((p, i) => element("option", { value: String(i), textContent: p.title && p.title !== p.name ? `${p.name}: ${p.title}` : p.name })));
  $("start").onchange = () => {
    const chosen = all[Number($("start").value)];
    if ($("start").value !== "" && chosen) set(chosen.segments.slice(), chosen.name);
    $("start").value = "";
  };
  $("heads").replaceChildren(...columns.concat("captive", "").map((words, i) => element("th", { scope: "col", textContent: words, className: i === 0 || i === 6 ? "word" : "" })));
  $("heads").lastChild.append(element("span", { className: "unseen" }, "take it up"));
  makeLayers();
  $("typed").value = state.segments.join(" ");
  $("name").value = state.name;
  $("undo").disabled = $("redo").disabled = true;
  showLayers();
}

// Hands.
function typed() {
  const words = $("typed").value.split(/[^0-9]+/).filter(Boolean).map(Number);
  const count = state.segments.length;
  const missing = state.segments.slice().sort((a, b) => a - b).filter((s) => !words.includes(s));
  if (words.length !== count || missing.length > 0) {
    $("typed").setAttribute("aria-invalid", "true");
    $("wrong").textContent = words.length !== count ? `Expected ${count} segments, found ${words.length}.` : `Each of 1 to ${count} lies on one layer: ${missing.join(", ")} is missing.`;
    return;
  }
  $("typed").removeAttribute("aria-invalid");
  $("wrong").textContent = "";
  set(words);
}

function dragging() {
  let from = null, start = null, pointer = null;
  const list = $("layers");
  const layerAt = (y) => {
    const rect = list.getBoundingClientRect(), count = state.segments.length;
    return Math.min(count, Math.max(1, count - Math.floor((y - rect.top) / rect.height * count)));
  };
  list.addEventListener("pointerdown", (event) => {
    const button = event.target.closest(".layer");
    if (!button || event.button !== 0) return;
    if (event.pointerType !== "mouse" && !event.target.closest(".grip")) return;
    from = Number(button.dataset.layer);
    start = { name: state.name, segments: state.segments };
    pointer = event.pointerId;
    list.setPointerCapture(pointer);
  });
  list.addEventListener("pointermove", (event) => {
    if (from === null || event.pointerId !== pointer) return;
    const to = layerAt(event.clientY);
    state.picked = to;
    const next = moved(start.segments, from, to);
    if (same(next, state.segments)) return;
    if (same(start.segments, state.segments)) {
      state.past.push(start);
      state.future = [];
    }
    set(next, null, false);
  });
  const end = (event) => {
    if (from === null) return;
    if (event.type === "pointerup") focusOn(layerAt(event.clientY));
    if (same(start.segments, state.segments) && state.past[state.past.length - 1] === start) state.past.pop();
    from = null;
    state.picked = null;
    $("undo").disabled = state.past.length === 0;
    showLayers();
  };
  list.addEventListener("pointerup", end);
  list.addEventListener("pointercancel", end);
}

function focusOn(layer) {
  for (const button of $("layers").querySelectorAll(".layer")) button.tabIndex = Number(button.dataset.layer) === layer ? 0 : -1;
  buttonOf(layer).focus();
}

function keys(event) {
  const button = event.target.closest(".layer");
  if (!button) return;
  const layer = Number(button.dataset.layer), count = state.segments.length;
  const to = { ArrowUp: layer + 1, ArrowDown: layer - 1, Home: count, End: 1 }[event.key];
  if (to !== undefined) {
    event.preventDefault();
    const there = Math.min(count, Math.max(1, to));
    if ((event.altKey || event.shiftKey || state.picked === layer) && there !== layer) {
      state.picked = state.picked === layer ? there : null;
      set(moved(state.segments, layer, there));
      say(`segment ${state.segments[there - 1]} is on layer ${there}`);
    }
    focusOn(there);
  } else if (event.key === " " || event.key === "Enter") {
    event.preventDefault();
    state.picked = state.picked === layer ? null : layer;
    showLayers();
  } else if (event.key === "Escape") {
    state.picked = null;
    showLayers();
  }
}

function keep(file, text) {
  const url = URL.createObjectURL(new Blob([text], { type: "application/toml" }));
  const link = element("a", { href: url, download: file });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 60000);
}

async function save(part) {
  try {
    const files = await ask({ ask: "save", name: $("name").value.trim(), segments: state.segments });
    keep(files[`${part}_file`], files[`${part}_toml`]);
    say(`${files[`${part}_file`]} is saved`);
  } catch (error) { fail(error); }
}

async function hint(asEasy) {
  try {
    const { segments } = state;
    say("looking at all exchanges of two layers");
    const found = await ask({ ask: "swap", segments, as_easy: asEasy });
    if (!same(segments, state.segments)) return;
    state.hint = found;
    $("hinted").hidden = false;
    $("take").hidden = !found.layers;
    $("hint").textContent = found.layers
      ? `Layers ${found.layers[0]} and ${found.layers[1]} exchanged: at worst ${found.worst_rate_deg_per_h.toFixed(4)} °/h, class ${found.class}. `
      : "No exchange of two layers makes the worst rate error smaller. ";
    say($("hint").textContent);
  } catch (error) { fail(error); }
}

function hands() {
  dragging();
  $("layers").addEventListener("keydown", keys);
  $("typed").addEventListener("change", typed);
  $("typed").addEventListener("keydown", (e) => { if (e.key === "Enter") { e.preventDefault(); typed(); } });
  $("name").addEventListener("change", () => { state.own = state.name = $("name").value.trim() || "mine"; refresh(); });
  $("undo").onclick = () => step(state.past, state.future);
  $("redo").onclick = () => step(state.future, state.past);
  document.addEventListener("keydown", (e) => {
    if (!(e.ctrlKey || e.metaKey) || /^(INPUT|TEXTAREA)$/.test(e.target.tagName)) return;
    const key = e.key.toLowerCase();
    if (key === "z" && !e.shiftKey) { e.preventDefault(); step(state.past, state.future); }
    if (key === "y" || (key === "z" && e.shiftKey)) { e.preventDefault(); step(state.future, state.past); }
  });
  $("compare").onclick = () => {
    state.kept = { name: `kept: ${state.name}`, segments: state.segments.slice(), judged: null };
    refresh();
  };
  $("help").onclick = () => hint(true);
  $("any").onclick = () => hint(false);
  $("take").onclick = () => { if (state.hint) set(state.hint.segments); };
  $("keep-pattern").onclick = () => save("pattern");
  $("keep-model").onclick = () => save("model");
  $("reset").onclick = () => { state.set = {}; reopen(); };
  $("profile").onchange = () => { state.follows = false; $("follow").checked = false; state.profile = $("profile").value; state.zoom = null; overTime().catch(fail); };
  $("follow").onchange = () => { state.follows = $("follow").checked; refresh(); };
  $("scale").onchange = drawRates;
  let moving = false;
  const to = (seconds) => {
    state.time = seconds;
    if (moving) return;
    moving = true;
    atTime().catch(fail).finally(() => { moving = false; });
  };
  $("time").oninput = () => to(Number($("time").value));
  const svg = $("rates");
  let from = null;
  svg.addEventListener("pointerdown", (e) => { if (view && e.pointerType === "mouse") from = timeUnder(e); });
  svg.addEventListener("pointermove", (e) => { if (view && (e.pointerType === "mouse" || e.buttons)) to(60 * timeUnder(e)); });
  svg.addEventListener("pointerup", (e) => {
    if (from === null) return;
    const until = timeUnder(e), span = view.range[1] - view.range[0];
    if (Math.abs(until - from) > 0.03 * span) state.zoom = [Math.min(from, until), Math.max(from, until)];
    from = null;
    $("whole").hidden = !state.zoom;
    drawRates();
  });
  $("whole").onclick = () => { state.zoom = null; $("whole").hidden = true; drawRates(); };
  addEventListener("resize", drawRates);
  addEventListener("beforeprint", drawRates);
}

hands();
startEngine().then(reopen).catch(fail);
})();
