"use strict";
// A picture over the whole window.
for(const z of document.querySelectorAll('.zoom')){let k=1,x=0,y=0,p=null,moved=false;const s=()=>z.querySelector('svg');
const set=()=>s().style.transform=z.classList.contains('open')?`translate(${x}px,${y}px) scale(${k})`:'';
const close=()=>{z.classList.remove('open');k=1;x=y=0;set()};
z.addEventListener('click',()=>{if(moved){moved=false;return}z.classList.contains('open')?close():z.classList.add('open');set()});
z.addEventListener('keydown',e=>{if(e.key==='Escape')close();if(e.key==='Enter'){z.classList.toggle('open');set()}});
z.addEventListener('wheel',e=>{if(!z.classList.contains('open'))return;e.preventDefault();const f=e.deltaY<0?1.2:1/1.2;x=e.clientX-(e.clientX-x)*f;y=e.clientY-(e.clientY-y)*f;k*=f;set()},{passive:false});
z.addEventListener('pointerdown',e=>{if(z.classList.contains('open'))p=[e.clientX-x,e.clientY-y]});
z.addEventListener('pointermove',e=>{if(p&&e.buttons){x=e.clientX-p[0];y=e.clientY-p[1];moved=true;set()}});
z.addEventListener('pointerup',()=>p=null)}

// What a chart shows where the pointer is: axes and names stand in its data-plot.
const charts = [];
const shown = (v) => v === 0 ? "0" : Math.abs(v) >= 1e5 || Math.abs(v) < 1e-3 ? v.toExponential(2) : String(Number(v.toPrecision(3)));
for (const svg of document.querySelectorAll("svg[data-plot]")) {
  const plot = JSON.parse(svg.dataset.plot), [left, top, right, bottom] = plot.frame;
  const lines = plot.series.map(({ name, colour }) => ({ name, parts: [...svg.querySelectorAll("polyline")].filter((part) =>
    part.getAttribute("stroke").toUpperCase() === colour && part.points.length > 1 && part.points[0].y >= top - 4) })).filter((line) => line.parts.length);
  if (!lines.length) continue;
  const figure = svg.closest("figure"), zoom = svg.parentElement;
  const read = document.createElement("p"), keys = document.createElement("p"), rule = document.createElementNS(svg.namespaceURI, "line");
  read.className = "read";
  keys.className = "lines";
  for (const [key, value] of Object.entries({ y1: top, y2: bottom, stroke: "currentColor", "stroke-width": 4, "stroke-dasharray": "12 8", visibility: "hidden" })) rule.setAttribute(key, value);
  svg.append(rule);
  const value = ([low, high, log], share) => log ? 10 ** (low + share * (high - low)) : low + share * (high - low);
  /** Where a line is at a place along x: between the two of its points around it. */
  const height = (line, x) => {
    for (const { points } of line.parts) {
      for (let i = 1; i < points.length; i++) {
        const a = points[i - 1], b = points[i];
        if (a.x <= x && x <= b.x) return b.x === a.x ? b.y : a.y + (b.y - a.y) * (x - a.x) / (b.x - a.x);
      }
    }
    return null;
  };
  const chart = {
    label: plot.x_label,
    at: null,
    /** Shows the values at a share of the frame's width. */
    show(share) {
      chart.at = share;
      const x = left + share * (right - left);
      rule.setAttribute("x1", x);
      rule.setAttribute("x2", x);
      rule.setAttribute("visibility", "visible");
      const words = lines.filter((line) => !line.hidden).map((line) => [line.name, height(line, x)]).filter(([, y]) => y !== null)
        .map(([name, y]) => `${name || plot.y_label}: ${shown(value(plot.y, (bottom - y) / (bottom - top)))}`);
      read.textContent = `${plot.x_label} ${shown(value(plot.x, share))} — ${words.join("; ")}`;
    },
    /** The same place of another chart's axis. */
    follow(place) {
      const [low, high, log] = plot.x, share = ((log ? Math.log10(place) : place) - low) / (high - low);
      if (share >= 0 && share <= 1) chart.show(share);
    },
    place: () => value(plot.x, chart.at),
  };
  charts.push(chart);
  const move = (share) => {
    chart.show(Math.min(1, Math.max(0, share)));
    if (/time/.test(plot.x_label)) for (const other of charts) if (other !== chart && other.label === chart.label) other.follow(chart.place());
  };
  svg.addEventListener("pointermove", (event) => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    if (at.x >= left && at.x <= right) move((at.x - left) / (right - left));
  });
  zoom.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -0.01, ArrowRight: 0.01 }[event.key];
    if (!by) return;
    event.preventDefault();
    move((chart.at ?? 0.5) + by);
    read.setAttribute("aria-live", "polite");
  });
  if (lines.length > 1) {
    for (const line of lines) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = line.name;
      button.setAttribute("aria-pressed", "true");
      button.onclick = () => {
        line.hidden = !line.hidden;
        button.setAttribute("aria-pressed", String(!line.hidden));
        for (const part of line.parts) part.style.display = line.hidden ? "none" : "";
        if (chart.at !== null) chart.show(chart.at);
      };
      keys.append(button);
    }
  }
  zoom.after(read, keys);
}
