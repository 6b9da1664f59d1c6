"use strict";
// What a page can do where scripts run: pictures over the whole window, and charts whose values can be read, zoomed, put on
// another scale, switched on and off, and seen as differences. Without scripts and on paper the page is complete as it is.
(() => {
const SVG = "http://www.w3.org/2000/svg", FINE = 4, TEXT = 13 * FINE, LEAST_ROOM = 60 * FINE;
/** What is smaller than this part of the smallest line's largest value is drawn there, where a scale of sizes needs an end. */
const SHOWN_BELOW = 300;

const element = (tag, properties, ...children) => {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) if (key in made) made[key] = value; else made.setAttribute(key, value);
  made.append(...children);
  return made;
};
const drawn = (tag, attributes, text) => {
  const made = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
};
const digits = (v, n = 4) => {
  if (v === null || !Number.isFinite(v)) return "–";
  const size = Math.abs(v);
  return (v === 0 ? "0" : size >= 1e6 || size < 1e-3 ? v.toExponential(n - 1) : String(Number(v.toPrecision(n)))).replace("-", "−");
};

/** Where numbers stand along an axis between two places. */
function ticks({ log }, low, high, wanted) {
  const found = [];
  if (log) {
    const few = high - low < 1.6, every = Math.max(1, Math.ceil((high - low) / wanted));
    for (let decade = Math.floor(low); decade <= high; decade++) {
      for (let m = 1; m < 10; m++) {
        const at = decade + Math.log10(m), value = m * 10 ** decade;
        if (at < low - 1e-9 || at > high + 1e-9) continue;
        const named = few ? [1, 2, 5].includes(m) : m === 1 && decade % every === 0;
        if (named || every === 1) found.push({ at, label: named ? digits(value, 2) : "" });
      }
    }
    return found;
  }
  const raw = (high - low) / wanted, decade = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * decade).find((s) => s >= 0.7 * raw);
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) {
    found.push({ at: i * step, label: digits(Number((i * step).toPrecision(10)), 6) });
  }
  return found;
}

/** What a line says at a place, between the two points around it; a step holds its value. */
function valueAt({ shape, x, y }, at) {
  let low = 0, high = x.length - 1;
  if (high < 0 || at < x[0] || at > x[high]) return null;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (x[middle] <= at) low = middle; else high = middle;
  }
  if (y[low] === null || y[high] === null) return null;
  if (shape === "step" || shape === "columns") return y[at === x[high] ? high : low];
  return x[high] === x[low] ? y[high] : y[low] + (y[high] - y[low]) * (at - x[low]) / (x[high] - x[low]);
}

const charts = [];
/** Charts over the same time show the same time. */
const linked = (chart) => charts.filter((other) => other === chart || (/time/.test(chart.plot.x.label) && other.plot.x.label === chart.plot.x.label));

function makeChart(figure, svg) {
  const plot = JSON.parse(svg.dataset.plot), box = figure.querySelector(".zoom"), still = svg.querySelector(".plot");
  const [left, top, right, bottom] = plot.frame, lying = plot.categories.length > 0;
  const lines = plot.series.filter((s) => ["line", "step", "dashed"].includes(s.shape));
  const named = plot.series.filter((s) => s.name);
  const scaled = lying ? "x" : "y", cells = plot.series.some((s) => s.shape === "cells");
  const first = { view: null, log: plot[scaled].log, less: "" };
  const state = { ...first, hidden: new Set() };
  const chart = { plot, at: null };
  let live = null, rule = null, pulled = null, rulers = null;

  const reference = () => state.less ? plot.series.find((s) => s.name === state.less) : undefined;
  /** A series as it is shown: as it is, or less the reference. */
  const values = (series) => {
    const other = reference();
    return other && series.y.map((v, i) => { const o = valueAt(other, series.x[i]); return v === null || o === null ? null : v - o; }) || series.y;
  };
  const visible = () => plot.series.filter((s) => !state.hidden.has(s.name) && !(state.less && s.name === state.less));
  const changed = () => state.view || state.log !== first.log || state.less || state.hidden.size;

  /** The axes as they are now: label, ends, and where a value lies. */
  function axes() {
    const shown = visible(), floorOf = (lists) => {
      const tops = lists.map((list) => Math.max(...list.map(Math.abs))).filter((t) => t > 0);
      return lists.some((list) => list.some((v) => v <= 0)) ? Math.min(...tops, Number.MAX_VALUE) / SHOWN_BELOW : 0;
    };
    const axis = (name, lists) => {
      const own = plot[name], log = name === scaled ? state.log : own.log;
      const sizes = lists.map((list) => list.filter((v) => v !== null)).filter((list) => list.length);
      const signed = sizes.some((list) => list.some((v) => v < 0));
      const floor = log ? (!state.less && own.floor) || floorOf(sizes) : 0;
      const place = (v) => v === null ? null : log ? Math.log10(Math.max(Math.abs(v), floor || 1e-300)) : v;
      let label = own.floor && (!log || state.less) ? own.label.replace(/\|/g, "") : own.label;
      if (name === scaled && state.less) label = `difference: ${label}`;
      if (log && signed && !label.includes("|")) label = `size of ${label}`;
      return { log, place, back: (p) => log ? 10 ** p : p, label };
    };
    const xs = shown.map((s) => s.x), ys = shown.map((s) => lying ? [] : values(s));
    const x = axis("x", xs), y = axis("y", ys);
    const ends = (a, lists, margin) => {
      let low = Number.MAX_VALUE, high = -Number.MAX_VALUE;
      for (const v of lists.flat()) { const p = a.place(v); if (p !== null && Number.isFinite(p)) { low = Math.min(low, p); high = Math.max(high, p); } }
      if (low > high) [low, high] = [0, 1];
      if (high - low < 1e-12 * Math.max(Math.abs(low), Math.abs(high), 1e-12)) [low, high] = [low - 0.5, high + 0.5];
      return [low - margin * (high - low), high + margin * (high - low)];
    };
    if (lying) {
      [x.low, x.high] = ends(x, state.log ? xs : [...xs, [0]], 0.03);
      x.high += 0.3 * (x.high - x.low);
    } else {
      [x.low, x.high] = state.view || [plot.x.low, plot.x.high];
      const inside = shown.map((s, i) => ys[i].filter((_, j) => { const p = x.place(s.x[j]); return p >= x.low && p <= x.high; }));
      const edges = shown.map((s, i) => s.shape === "points" || s.shape === "columns" ? [] : [x.low, x.high].map((p) => valueAt({ ...s, y: ys[i] }, x.back(p))));
      const marks = state.less ? [] : plot.marks.filter((m) => m.along === "y").map((m) => m.value);
      [y.low, y.high] = ends(y, [...inside, ...edges, marks, shown.some((s) => s.shape === "columns") && !y.log ? [0] : []], 0.05);
    }
    return { x, y };
  }
  const px = (x, p) => left + (p - x.low) / (x.high - x.low) * (right - left);
  const py = (y, p) => bottom - (p - y.low) / (y.high - y.low) * (bottom - top);

  /** Draws the chart as it is now wanted; as it was printed where nothing is changed. */
  function draw() {
    live?.remove();
    live = null;
    still.style.display = changed() ? "none" : "";
    const as = (a) => ({ ...a, place: (v) => a.log ? Math.log10(Math.max(Math.abs(v), a.floor || 1e-300)) : v, back: (p) => a.log ? 10 ** p : p });
    rulers = changed() ? axes() : { x: as(plot.x), y: as(plot.y) };
    if (changed()) {
      live = drawn("g", { "font-size": TEXT, fill: "currentColor" });
      paint(live, rulers);
      still.after(live);
    }
    for (const [name, button] of keys) button.setAttribute("aria-pressed", String(!state.hidden.has(name)));
    if (logs) logs.setAttribute("aria-pressed", String(state.log));
    if (whole) whole.disabled = !changed();
    if (less) less.value = state.less;
    chart.show(chart.at);
  }

  function paint(into, { x, y }) {
    const add = (tag, attributes, text) => into.append(drawn(tag, attributes, text));
    const grid = (from, to, weak) => add("path", { d: `M${from}L${to}`, stroke: "currentColor", "stroke-opacity": weak ? 0.06 : 0.16, "stroke-width": FINE });
    for (const band of state.less || lying ? [] : plot.bands) {
      const clamp = (v, low, high) => Math.min(high, Math.max(low, v)), of = band.along === "x" ? x : y;
      const [from, to] = [band.from, band.to].map((v) => clamp(of.place(v), of.low, of.high)).sort((a, b) => a - b);
      const [a, b, c, d] = band.along === "x" ? [px(x, from), top, px(x, to), bottom] : [left, py(y, to), right, py(y, from)];
      if (c > a && d > b) add("rect", { x: a, y: b, width: c - a, height: d - b, fill: band.colour, "fill-opacity": 0.18 });
    }
    for (const { at, label } of ticks(x, x.low, x.high, (right - left) / (95 * FINE))) {
      grid(`${px(x, at)} ${top}`, `${px(x, at)} ${bottom}`, !label);
      add("text", { x: px(x, at), y: bottom + 6 * FINE + TEXT * 0.85, "text-anchor": "middle" }, label);
    }
    for (const { at, label } of lying ? [] : ticks(y, y.low, y.high, Math.max(2, (bottom - top) / (46 * FINE)))) {
      grid(`${left} ${py(y, at)}`, `${right} ${py(y, at)}`, !label);
      add("text", { x: left - 6 * FINE, y: py(y, at) + TEXT * 0.35, "text-anchor": "end" }, label);
    }
    const row = (bottom - top) / Math.max(1, plot.categories.length);
    plot.categories.forEach((name, i) => add("text", { x: left - 6 * FINE, y: top + row * (i + 0.5) + TEXT * 0.35, "text-anchor": "end" }, name));
    add("path", { d: `M${left} ${top}V${bottom}H${right}`, stroke: "currentColor", "stroke-opacity": 0.7, "stroke-width": FINE, fill: "none" });
    add("text", { x: (left + right) / 2, y: bottom + 25 * FINE + TEXT * 0.85, "text-anchor": "middle" }, x.label);
    const middle = (top + bottom) / 2;
    add("text", { x: 6 * FINE + TEXT * 0.85, y: middle, "text-anchor": "middle", transform: `rotate(270 ${6 * FINE + TEXT * 0.85} ${middle})` }, y.label);
    const clip = drawn("svg", { x: left, y: top, width: right - left, height: bottom - top, viewBox: `${left} ${top} ${right - left} ${bottom - top}` });
    into.append(clip);
    const inside = (tag, attributes) => clip.append(drawn(tag, attributes));
    const bars = plot.series.length, taken = [], marked = [], words = [];
    plot.series.forEach((s, rank) => {
      if (!visible().includes(s)) return;
      const shown = values(s), at = (i) => [px(x, x.place(s.x[i])), py(y, y.place(shown[i]))];
      if (s.shape === "bars") {
        s.x.forEach((v, i) => {
          if (v === null || (x.log && v <= 0)) return;
          const zero = px(x, x.log ? x.low : Math.max(x.low, Math.min(0, x.high))), end = px(x, x.place(v));
          const at = top + row * (s.y[i] + 0.5) + (rank - 0.5 * (bars - 1)) * 14 * FINE;
          add("rect", { x: Math.min(zero, end), y: at - 6 * FINE, width: Math.max(FINE, Math.abs(end - zero)), height: 12 * FINE, fill: s.colour, "fill-opacity": 0.9 });
          const before = end < zero;
          // Over the marks, so that no line crosses a word.
          words.push([{ x: end + (before ? -4 : 4) * FINE, y: at + TEXT * 0.35, "text-anchor": before ? "end" : "start" }, s.labels[i] || digits(v, 3)]);
        });
      } else if (s.shape === "columns") {
        for (let i = 0; i + 1 < s.x.length; i++) {
          const [a, high] = at(i), b = px(x, x.place(s.x[i + 1])), base = py(y, y.log ? y.low : 0);
          if (shown[i] > 0) inside("rect", { x: a, y: high, width: Math.max(0, b - a - FINE), height: Math.max(0, base - high), fill: s.colour, "fill-opacity": 0.8 });
        }
      } else if (s.shape === "points") {
        s.x.forEach((v, i) => {
          if (v === null || shown[i] === null || (y.log && shown[i] <= 0)) return;
          const [cx, cy] = at(i), error = s.errors[i];
          if (cx < left || cx > right || cy < top || cy > bottom) return;
          if (error) inside("path", { d: `M${cx} ${py(y, y.place(shown[i] + error))}V${y.log && shown[i] <= error ? bottom : py(y, y.place(shown[i] - error))}`, stroke: s.colour, "stroke-width": FINE });
          inside("circle", { cx, cy, r: (s.x.length > 300 ? 2 : 4) * FINE, fill: s.colour, "fill-opacity": 0.85 });
          if (s.labels[i]) word(add, taken, cx, cy, s.labels[i]);
        });
      } else {
        const parts = [];
        let pen = "M";
        s.x.forEach((_, i) => {
          if (shown[i] === null) { pen = "M"; return; }
          const [a, b] = at(i);
          parts.push(s.shape === "step" && pen === "L" ? `H${a.toFixed(1)}V${b.toFixed(1)}` : `${pen}${a.toFixed(1)} ${b.toFixed(1)}`);
          pen = "L";
        });
        inside("path", { d: parts.join(""), fill: "none", stroke: s.colour, "stroke-width": 1.75 * FINE, "stroke-linejoin": "round", "stroke-dasharray": s.shape === "dashed" ? `${6 * FINE} ${4 * FINE}` : "none" });
      }
    });
    for (const mark of state.less ? [] : plot.marks) {
      const p = (mark.along === "x" ? x : y).place(mark.value), of = mark.along === "x" ? x : y;
      if (p < of.low || p > of.high) continue;
      const [from, to] = mark.along === "x" ? [`${px(x, p)} ${top}`, `${px(x, p)} ${bottom}`] : [`${left} ${py(y, p)}`, `${right} ${py(y, p)}`];
      add("path", { d: `M${from}L${to}`, stroke: "currentColor", "stroke-opacity": 0.55, "stroke-width": FINE, "stroke-dasharray": `${5 * FINE} ${4 * FINE}` });
      if (!mark.label) continue;
      if (mark.along === "y") {
        add("text", { x: right - 4 * FINE, y: Math.max(top + TEXT, py(y, p) - 4 * FINE), "text-anchor": "end" }, mark.label);
        continue;
      }
      // Words that would lie on one another go to different rows.
      const wide = 0.58 * TEXT * mark.label.length, start = Math.max(left, Math.min(right - wide, px(x, p) - wide / 2));
      let level = 0;
      while (level < 5 && marked.some((t) => t[1] === level && start < t[2] && t[0] < start + wide)) level++;
      marked.push([start, level, start + wide + 8 * FINE]);
      add("text", { x: start, y: top - 4 * FINE - level * 17 * FINE }, mark.label);
    }
    for (const [attributes, text] of words) add("text", attributes, text);
  }

  /** A word beside a point, where it lies on no other. */
  function word(add, taken, cx, cy, text) {
    const wide = 0.58 * TEXT * text.length, high = TEXT * 1.15;
    for (let row = 0; row < 24; row++) {
      const y = cy + (row % 2 ? 1 : -1) * Math.ceil((row + 1) / 2) * high * 0.7;
      for (const x of [cx + 7 * FINE, cx - 7 * FINE - wide]) {
        const area = [x, y - high / 2, x + wide, y + high / 2];
        if (area[0] < left || area[2] > right || area[1] < top || area[3] > bottom || taken.some((t) => area[0] < t[2] && t[0] < area[2] && area[1] < t[3] && t[1] < area[3])) continue;
        taken.push(area);
        add("text", { x, y: y + TEXT * 0.35 }, text);
        return;
      }
    }
  }

  // Values.
  const read = element("p", { className: "read" }), keys = new Map(), outputs = new Map();
  /** Shows what the chart says at a place along x; none takes the rule away. */
  chart.show = (at) => {
    chart.at = at;
    rule?.remove();
    rule = null;
    read.textContent = at === null ? "" : `${plot.x.label} ${digits(at)}`;
    for (const output of outputs.values()) output.textContent = "";
    if (at === null || lying || cells) return;
    const p = rulers.x.place(at);
    if (p < rulers.x.low - 1e-9 || p > rulers.x.high + 1e-9) { read.textContent = ""; return; }
    rule = drawn("path", { d: `M${px(rulers.x, p)} ${top}V${bottom}`, stroke: "currentColor", "stroke-width": FINE, "stroke-dasharray": `${3 * FINE} ${2 * FINE}` });
    svg.append(rule);
    for (const s of visible()) {
      let value;
      if (s.shape === "points") {
        const near = s.x.reduce((best, v, i) => best === null || Math.abs(rulers.x.place(v) - p) < Math.abs(rulers.x.place(s.x[best]) - p) ? i : best, null);
        if (near === null) continue;
        value = values(s)[near];
        read.textContent += ` · nearest: ${s.labels[near] || digits(s.x[near])}`;
      } else value = valueAt({ ...s, y: values(s) }, at);
      const output = outputs.get(s.name);
      if (output) output.textContent = digits(value);
      else read.textContent += `: ${digits(value)}`;
    }
  };
  const moved = (at) => { for (const other of linked(chart)) other.show(at); };
  const placeOf = (event) => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    const share = Math.min(1, Math.max(0, (at.x - left) / (right - left)));
    return { share, place: rulers.x.low + share * (rulers.x.high - rulers.x.low), inside: at.x >= left && at.x <= right && at.y >= top && at.y <= bottom };
  };
  /** Looks at a part of x, given as places on its ruler. */
  const look = (view) => { for (const other of linked(chart)) other.look(view); };
  chart.look = (view) => {
    const full = [plot.x.low, plot.x.high];
    const cut = view && [Math.max(full[0], view[0]), Math.min(full[1], view[1])];
    state.view = cut && cut[1] - cut[0] > 1e-6 * (full[1] - full[0]) && cut[1] - cut[0] < 0.999 * (full[1] - full[0]) ? cut : null;
    draw();
  };
  const zoom = (factor) => {
    const { x } = rulers, middle = chart.at !== null ? x.place(chart.at) : (x.low + x.high) / 2;
    look([middle - (middle - x.low) / factor, middle + (x.high - middle) / factor]);
  };

  // Tools.
  const tools = element("div", { className: "tools" });
  const button = (words, act, pressed) => {
    const made = element("button", { type: "button", textContent: words, onclick: act });
    if (pressed !== undefined) made.setAttribute("aria-pressed", String(pressed));
    tools.append(made);
    return made;
  };
  const logs = cells ? null : button("log scale", () => { state.log = !state.log; draw(); }, state.log);
  let less = null;
  if (lines.length > 1 && lines.length === plot.series.length) {
    less = element("select", { onchange: () => { state.less = less.value; draw(); } }, element("option", { value: "", textContent: "nothing" }));
    for (const s of lines.filter((s) => s.name)) less.append(element("option", { value: s.name, textContent: s.name }));
    tools.append(element("label", {}, "less ", less));
  }
  let whole = null;
  if (!cells) {
    if (!lying) {
      button("zoom in", () => zoom(2));
      button("zoom out", () => zoom(0.5));
    }
    whole = button("as printed", () => { Object.assign(state, first); state.hidden.clear(); look(null); draw(); });
  }
  enlarge(figure, button);
  const list = element("div", { className: "keys" });
  if (named.length > 1 && !cells) {
    for (const s of named) {
      if (keys.has(s.name)) continue;
      const key = element("button", { type: "button", onclick: () => { if (!state.hidden.delete(s.name)) state.hidden.add(s.name); draw(); } }, s.name);
      key.style.borderLeft = `.7em solid ${s.colour}`;
      const output = element("output", {});
      keys.set(s.name, key);
      outputs.set(s.name, output);
      list.append(element("div", {}, key, output));
    }
  }
  const panel = element("div", { className: "panel" }, tools, read, list);
  box.after(panel);
  if (cells) return;
  charts.push(chart);
  draw();
  if (lying) return;
  box.setAttribute("aria-label", "chart: arrow keys read its values, plus and minus zoom");
  svg.addEventListener("pointermove", (event) => {
    const { share, place, inside } = placeOf(event);
    if (pulled) {
      const from = px(rulers.x, pulled.place), to = left + share * (right - left);
      pulled.area.setAttribute("x", Math.min(from, to));
      pulled.area.setAttribute("width", Math.abs(to - from));
    }
    if (inside || pulled) moved(rulers.x.back(place));
  });
  svg.addEventListener("pointerdown", (event) => {
    const { place, inside } = placeOf(event);
    if (!inside || event.pointerType === "touch" || event.button) return;
    pulled = { place, area: drawn("rect", { y: top, height: bottom - top, fill: "currentColor", "fill-opacity": 0.12 }) };
    svg.append(pulled.area);
    svg.setPointerCapture(event.pointerId);
    event.preventDefault();
  });
  svg.addEventListener("pointerup", (event) => {
    if (!pulled) return;
    const { place, area } = { ...pulled }, to = placeOf(event).place;
    area.remove();
    pulled = null;
    if (Math.abs(px(rulers.x, to) - px(rulers.x, place)) > LEAST_ROOM / 4) look([Math.min(place, to), Math.max(place, to)]);
  });
  svg.addEventListener("dblclick", () => look(null));
  box.addEventListener("keydown", (event) => {
    const { x } = rulers, by = { ArrowLeft: -0.01, ArrowRight: 0.01 }[event.key];
    if (by) {
      read.setAttribute("aria-live", "polite");
      const now = chart.at === null ? (x.low + x.high) / 2 : x.place(chart.at);
      moved(x.back(Math.min(x.high, Math.max(x.low, now + by * (x.high - x.low)))));
    } else if (event.key === "+" || event.key === "-") zoom(event.key === "+" ? 2 : 0.5);
    else if (event.key === "0") look(null);
    else return;
    event.preventDefault();
  });
}

/** A button that shows a figure over the whole window; Escape brings it back. */
function enlarge(figure, button) {
  const set = (open) => {
    figure.classList.toggle("open", open);
    made.textContent = open ? "back to the page" : "enlarge";
  };
  const made = button("enlarge", () => set(!figure.classList.contains("open")));
  figure.addEventListener("keydown", (event) => { if (event.key === "Escape") set(false); });
}

for (const figure of document.querySelectorAll("figure")) {
  const svg = figure.querySelector("svg[data-plot]");
  if (svg) { makeChart(figure, svg); continue; }
  const tools = element("div", { className: "tools" });
  enlarge(figure, (words, act) => {
    const made = element("button", { type: "button", textContent: words, onclick: act });
    tools.append(made);
    return made;
  });
  figure.querySelector(".zoom").after(element("div", { className: "panel" }, tools));
}
// What scrolls by itself can be scrolled by keys.
const reach = () => {
  for (const box of document.querySelectorAll(".scroll")) {
    if (box.scrollWidth <= box.clientWidth) continue;
    box.tabIndex = 0;
    box.setAttribute("role", "group");
    box.setAttribute("aria-label", "table that scrolls sideways");
  }
};
reach();
addEventListener("resize", reach);
})();
