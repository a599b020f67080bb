"use strict";
// Charts from data, in SVG: pointing reads a curve off, dragging zooms, a double click shows all again.
// `views` has each chart by its key, for what a page draws over it.
const views = (() => {
  const NS = "http://www.w3.org/2000/svg";
  const make = (tag, attributes, parent) => {
    const node = document.createElementNS(NS, tag);
    for (const name in attributes) node.setAttribute(name, attributes[name]);
    if (parent) parent.appendChild(node);
    return node;
  };
  const views = new Map();
  const dark = matchMedia("(prefers-color-scheme: dark)");
  // On a dark page the colours are lighter.
  const colour = (i) => `rgb(${palette[i % palette.length].map((c) => (dark.matches ? Math.round(c + (255 - c) * 0.35) : c)).join(",")})`;
  const finite = (v) => typeof v === "number" && Number.isFinite(v);

  // An axis maps values to a line on which it is linear, and back.
  const scale = (axis) => axis.logarithmic
    ? { to: (v) => (finite(v) && v !== 0 ? Math.log10(Math.abs(v)) : NaN), from: (p) => 10 ** p }
    : { to: (v) => (finite(v) ? v : NaN), from: (p) => p };

  const extent = (values, pad) => {
    let low = Infinity, high = -Infinity;
    for (const v of values) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); }
    if (!(low <= high)) return [0, 1];
    if (low === high) { low -= 1; high += 1; }
    const room = pad * (high - low);
    return [low - room, high + room];
  };

  const short = (v) => {
    if (v === 0) return "0";
    const size = Math.abs(v);
    if (size >= 1e5 || size < 1e-3) return v.toExponential(2).replace("-", "−").replace("e", "·10^").replace("+", "");
    return String(Number(v.toPrecision(4))).replace("-", "−");
  };

  const ticks = (axis, [low, high], count) => {
    const found = [];
    if (axis.logarithmic && high - low > 1.2) {
      const every = Math.max(1, Math.ceil((high - low) / count));
      for (let e = Math.ceil(low - 1e-9); e <= high + 1e-9; e += every) found.push([e, short(10 ** e)]);
      return found;
    }
    if (axis.logarithmic) {
      const [from, to] = [10 ** low, 10 ** high];
      for (const t of ticks({ logarithmic: false }, [from, to], count)) {
        const v = Number(t[2]);
        if (v > 0) found.push([Math.log10(v), t[1]]);
      }
      return found;
    }
    const rough = (high - low) / count, power = 10 ** Math.floor(Math.log10(rough));
    const step = power * [1, 2, 5, 10].find((f) => f * power >= rough * 0.999);
    for (let i = Math.ceil(low / step - 1e-9); i <= Math.floor(high / step + 1e-9); i++) {
      found.push([i * step, short(Number((i * step).toPrecision(12))), i * step]);
    }
    return found;
  };

  const draw = (holder, chart) => {
    const [sx, sy] = [scale(chart.x), scale(chart.y)];
    const curves = chart.curves.map((c) => ({
      ...c, shown: true, px: c.x.map(sx.to), py: c.y.map(sy.to),
    }));
    const discs = chart.discs;
    const home = () => {
      const shown = curves.filter((c) => c.shown);
      const all = (axis, s, values, marks, index) => axis.range ? axis.range.map(s.to)
        : extent([...values, ...marks.map((m) => s.to(m.at)),
          ...discs.flatMap((d) => [d.centre[index] - d.radius, d.centre[index] + d.radius])], 0.04);
      return [all(chart.x, sx, shown.flatMap((c) => c.px), chart.verticals, 0),
        all(chart.y, sy, shown.flatMap((c) => c.py), chart.horizontals, 1)];
    };
    let view = home();
    // What a page needs to draw over the chart, and what it does after each drawing.
    const seen = { after: [], curves, X: (v) => X(sx.to(v)), Y: (v) => Y(sy.to(v)) };
    holder.textContent = "";
    holder.classList.add("live");
    const svg = make("svg", { role: "img", "aria-label": chart.title }, holder);
    const output = document.createElement("output");
    const bar = document.createElement("div");
    bar.className = "bar";
    holder.append(output, bar);
    const clip = `clip-${holder.dataset.chart}`;
    let area, unit;
    // Equal axes: the range that is too narrow for the area grows around its middle.
    const fitted = ([x, y]) => {
      if (!chart.equal) return [x, y];
      const u = Math.max((x[1] - x[0]) / area.width, (y[1] - y[0]) / area.height);
      const grow = ([low, high], pixels) => {
        const middle = (low + high) / 2;
        return [middle - (u * pixels) / 2, middle + (u * pixels) / 2];
      };
      return [grow(x, area.width), grow(y, area.height)];
    };
    const X = (p) => area.left + ((p - view[0][0]) / (view[0][1] - view[0][0])) * area.width;
    const Y = (p) => area.top + area.height - ((p - view[1][0]) / (view[1][1] - view[1][0])) * area.height;
    const place = (x, y) => [view[0][0] + ((x - area.left) / area.width) * (view[0][1] - view[0][0]),
      view[1][0] + ((area.top + area.height - y) / area.height) * (view[1][1] - view[1][0])];

    const render = () => {
      // In pixels of the screen, so that text has its size on a phone too.
      const width = Math.max(280, holder.clientWidth || 800), small = width < 560;
      const height = Math.round(chart.equal ? Math.min(width * 0.8, 620) : Math.max(260, Math.min(width * 0.55, 440)));
      area = { left: small ? 56 : 74, top: chart.title || chart.verticals.length ? 44 : 12, width: 0, height: 0 };
      area.width = width - area.left - 12;
      area.height = height - area.top - 48;
      view = fitted(view);
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      svg.textContent = "";
      unit = area.width / (view[0][1] - view[0][0]);
      const text = (x, y, s, more) => {
        const node = make("text", { x, y, "font-size": small ? 11 : 12, fill: "var(--ink)", ...more }, svg);
        node.textContent = s;
        return node;
      };
      text(area.left + area.width / 2, 18, chart.title, { "text-anchor": "middle", "font-size": small ? 13 : 15 });
      const right = area.left + area.width, bottom = area.top + area.height;
      for (const [p, label] of ticks(chart.x, view[0], small ? 5 : 9)) {
        make("line", { x1: X(p), x2: X(p), y1: area.top, y2: bottom, stroke: "var(--line)" }, svg);
        text(X(p), bottom + 16, label, { "text-anchor": "middle" });
      }
      for (const [p, label] of ticks(chart.y, view[1], small ? 5 : 7)) {
        make("line", { x1: area.left, x2: right, y1: Y(p), y2: Y(p), stroke: "var(--line)" }, svg);
        text(area.left - 6, Y(p) + 4, label, { "text-anchor": "end" });
      }
      make("rect", { x: area.left, y: area.top, width: area.width, height: area.height, fill: "none", stroke: "var(--soft)" }, svg);
      text(area.left + area.width / 2, height - 8, chart.x.label, { "text-anchor": "middle" });
      const turned = { "text-anchor": "middle", transform: `rotate(-90 12 ${area.top + area.height / 2})` };
      text(12, area.top + area.height / 2 + 4, chart.y.label, turned);
      const box = make("clipPath", { id: clip }, make("defs", {}, svg));
      make("rect", { x: area.left, y: area.top, width: area.width, height: area.height }, box);
      const inner = make("g", { "clip-path": `url(#${clip})` }, svg);
      for (const d of discs) {
        make("circle", { cx: X(d.centre[0]), cy: Y(d.centre[1]), r: d.radius * unit, fill: "rgb(0,158,115)",
          "fill-opacity": 0.18, stroke: "rgb(0,158,115)" }, inner);
      }
      for (const m of chart.verticals) {
        const x = X(sx.to(m.at));
        if (!(x >= area.left && x <= right)) continue;
        make("line", { x1: x, x2: x, y1: area.top, y2: bottom, stroke: "var(--soft)", "stroke-dasharray": "3 3" }, inner);
        text(x, area.top - 6, m.label, { "text-anchor": "middle", fill: "var(--soft)" });
      }
      for (const m of chart.horizontals) {
        const y = Y(sy.to(m.at));
        if (!(y >= area.top && y <= bottom)) continue;
        make("line", { x1: area.left, x2: right, y1: y, y2: y, stroke: "var(--soft)", "stroke-dasharray": "3 3" }, inner);
        text(right - 4, y - 5, m.label, { "text-anchor": "end", fill: "var(--soft)" });
      }
      const far = 4 * Math.max(width, height);
      const near = (v) => Math.max(-far, Math.min(far, v));
      for (const c of curves) {
        if (!c.shown) continue;
        if (c.style === "points" || c.style === "crosses") {
          const dots = c.style === "points";
          let d = "";
          for (let i = 0; i < c.px.length; i++) {
            const [x, y] = [X(c.px[i]), Y(c.py[i])];
            if (inside([x, y])) d += dots ? `M${x.toFixed(1)} ${y.toFixed(1)}h0` : `M${(x - 3).toFixed(1)} ${(y - 3).toFixed(1)}l6 6m0 -6l-6 6`;
          }
          make("path", { d, class: "curve", fill: "none", stroke: colour(c.colour), "stroke-width": dots ? 5 : 2, "stroke-linecap": "round",
            "stroke-opacity": dots ? 0.75 : 1 }, inner);
          continue;
        }
        let d = "", pen = false, last = 0;
        for (let i = 0; i < c.px.length; i++) {
          if (!Number.isFinite(c.px[i]) || !Number.isFinite(c.py[i])) { pen = false; continue; }
          const [x, y] = [near(X(c.px[i])).toFixed(1), near(Y(c.py[i])).toFixed(1)];
          if (pen && c.style === "steps" && !c.dots) d += `L${x} ${last}`;
          d += `${pen ? "L" : "M"}${x} ${y}`;
          pen = true;
          last = y;
        }
        make("path", { d, class: "curve", fill: "none", color: colour(c.colour), stroke: colour(c.colour), "stroke-width": 2, "stroke-linejoin": "round",
          ...(c.style === "dashed" ? { "stroke-dasharray": "7 4" } : {}) }, inner);
        if (c.dots) for (let i = 0; i < c.px.length; i++) {
          if (Number.isFinite(c.py[i])) make("circle", { cx: X(c.px[i]), cy: Y(c.py[i]), r: 3, fill: colour(c.colour) }, inner);
        }
        c.ends.forEach((end, i) => {
          if (!end) return;
          const [x, y] = [X(sx.to(end[0])), Y(sy.to(end[1]))];
          if (i === 0) make("circle", { cx: x, cy: y, r: 4.5, fill: "var(--page)", stroke: colour(c.colour), "stroke-width": 2 }, inner);
          else make("path", { d: `M${x} ${y - 7}L${x + 7} ${y}L${x} ${y + 7}L${x - 7} ${y}Z`, fill: colour(c.colour), stroke: "var(--page)" }, inner);
        });
      }
      svg.cursor = make("g", { "pointer-events": "none" }, svg);
      svg.cursor.setAttribute("class", "cursor");
      Object.assign(seen, { inner, area });
      for (const draw of seen.after) draw();
    };

    const where = (event) => {
      const box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal;
      return [((event.clientX - box.left) / box.width) * view.width, ((event.clientY - box.top) / box.height) * view.height];
    };
    const inside = ([x, y]) => x >= area.left && x <= area.left + area.width && y >= area.top && y <= area.top + area.height;
    // The point nearest to a place, if one is near.
    const nearest = (at) => {
      let best = null;
      for (const c of curves) {
        if (!c.shown) continue;
        for (let i = 0; i < c.px.length; i++) {
          const [x, y] = [X(c.px[i]), Y(c.py[i])];
          const away = Math.hypot(x - at[0], y - at[1]);
          if (inside([x, y]) && (!best || away < best.away)) best = { away, c, i, x, y };
        }
      }
      return best && best.away <= 60 ? best : null;
    };
    const point = (at) => {
      svg.cursor.textContent = "";
      output.textContent = "";
      const best = nearest(at);
      if (!best) return;
      make("circle", { cx: best.x, cy: best.y, r: 5, fill: "none", stroke: "var(--ink)", "stroke-width": 2 }, svg.cursor);
      const label = best.c.names ? best.c.names[best.i] : best.c.label;
      output.textContent = `${label ? label + ": " : ""}${chart.x.label} = ${short(best.c.x[best.i])}, ` +
        `${chart.y.label} = ${short(best.c.y[best.i])}`;
    };
    const zoom = (from, to) => {
      const [a, b] = [place(...from), place(...to)];
      view = [0, 1].map((i) => [Math.min(a[i], b[i]), Math.max(a[i], b[i])]);
      render();
    };
    let drag = null;
    const fingers = new Map();
    let pinch = null;
    svg.addEventListener("pointerdown", (event) => {
      fingers.set(event.pointerId, where(event));
      if (fingers.size === 2) {
        drag = null;
        pinch = { view, at: [...fingers.values()] };
      } else if (inside(where(event)) && event.pointerType === "mouse") {
        drag = where(event);
        svg.setPointerCapture(event.pointerId);
      }
    });
    svg.addEventListener("pointermove", (event) => {
      const at = where(event);
      if (fingers.has(event.pointerId)) fingers.set(event.pointerId, at);
      if (pinch && fingers.size === 2) {
        const gap = (f) => Math.max(20, Math.hypot(f[0][0] - f[1][0], f[0][1] - f[1][1]));
        const factor = gap(pinch.at) / gap([...fingers.values()]);
        const middle = [(pinch.at[0][0] + pinch.at[1][0]) / 2, (pinch.at[0][1] + pinch.at[1][1]) / 2];
        view = pinch.view;
        const centre = place(...middle);
        view = pinch.view.map(([low, high], i) => [centre[i] - (centre[i] - low) * factor, centre[i] + (high - centre[i]) * factor]);
        render();
        return;
      }
      point(at);
      if (drag) {
        make("rect", { x: Math.min(drag[0], at[0]), y: Math.min(drag[1], at[1]), width: Math.abs(at[0] - drag[0]),
          height: Math.abs(at[1] - drag[1]), fill: "#0072b2", "fill-opacity": 0.12, stroke: "#0072b2" }, svg.cursor);
      }
    });
    const up = (event) => {
      const at = where(event);
      fingers.delete(event.pointerId);
      if (pinch) { if (fingers.size === 0) pinch = null; return; }
      if (drag && Math.abs(at[0] - drag[0]) > 8 && Math.abs(at[1] - drag[1]) > 8) zoom(drag, at);
      drag = null;
    };
    svg.addEventListener("pointerup", up);
    svg.addEventListener("pointercancel", up);
    svg.addEventListener("pointerleave", () => { if (!drag) { svg.cursor.textContent = ""; output.textContent = ""; } });
    const reset = () => { view = home(); render(); };
    svg.addEventListener("dblclick", reset);

    const button = (label, action) => {
      const node = document.createElement("button");
      node.type = "button";
      node.textContent = label;
      node.addEventListener("click", action);
      bar.appendChild(node);
      return node;
    };
    const by = (factor) => () => {
      view = view.map(([low, high]) => {
        const middle = (low + high) / 2, half = ((high - low) / 2) * factor;
        return [middle - half, middle + half];
      });
      render();
    };
    button("+", by(0.5)).title = "zoom in";
    button("−", by(2)).title = "zoom out";
    button("all", reset).title = "show all";
    for (const c of curves) {
      if (!c.label) continue;
      const key = button(c.label, () => {
        const shown = !c.shown;
        // Curves of one legend entry go together.
        for (const other of curves) if (other === c || (!other.label && other.colour === c.colour)) other.shown = shown;
        key.classList.toggle("off", !shown);
        render();
      });
      key.className = "key";
      const line = document.createElement("i");
      line.style.borderColor = line.style.color = colour(c.colour);
      if (c.style !== "solid") line.className = c.style;
      key.prepend(line);
    }
    render();
    // Whoever draws another chart here ends this one.
    holder.life?.abort();
    holder.life = new AbortController();
    addEventListener("resize", render, { signal: holder.life.signal });
    dark.addEventListener("change", render, { signal: holder.life.signal });
    holder.dataset.drawn = String(curves.length);
    return Object.assign(seen, { svg, at: (event) => place(...where(event)), nearest: (event) => nearest(where(event)) });
  };

  for (const [key, chart] of charts) {
    const holder = document.querySelector(`[data-chart="${key}"]`);
    if (holder) views.set(key, draw(holder, chart));
  }
  document.documentElement.dataset.ready = "yes";
  return Object.assign(views, { draw, make, colour, short });
})();
