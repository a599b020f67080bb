// Moves the time: the vehicles along their paths, the barriers that move, a cursor in each chart over time.
(() => {
  const { make, colour, short } = views;
  const slider = document.getElementById("time");
  if (!slider) return;
  const play = document.getElementById("play"), clock = document.getElementById("clock"), now = document.getElementById("now");
  const [first, last] = scene.time;
  // Time that playing takes, in s: as long as the run, within reason.
  const length = Math.min(15, Math.max(4, last - first));
  slider.min = first;
  slider.max = last;
  slider.step = (last - first) / 1000 || 1;
  slider.value = first;
  let time = first;

  // The position of the last entry of `times`, which rise, that is at most `t`.
  const before = (times, t) => {
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (times[middle] <= t) low = middle; else high = middle - 1;
    }
    return low;
  };
  // The values of `lists` at `t`, on straight lines between their points.
  const between = (times, lists, t) => {
    const i = before(times, t), j = Math.min(i + 1, times.length - 1);
    const part = j > i ? Math.min(1, Math.max(0, (t - times[i]) / (times[j] - times[i]))) : 0;
    return lists.map((list) => list[i] + part * (list[j] - list[i]));
  };
  const movers = [];

  // The tube of a first plan, beneath the curves.
  for (const [key, areas] of scene.areas) {
    const view = views.get(key);
    if (!view) continue;
    const draw = () => {
      const beneath = make("g", { class: "tube", "pointer-events": "none" });
      for (const area of areas) {
        const line = (ring) => `M${ring.map(([x, y]) => `${view.X(x).toFixed(1)} ${view.Y(y).toFixed(1)}`).join("L")}Z`;
        make("path", { d: area.rings.map(line).join(""), fill: colour(area.colour) }, beneath);
      }
      view.inner.prepend(beneath);
    };
    view.after.push(draw);
    draw();
  }

  const path = views.get("path");
  if (path) {
    const outline = (o) => {
      const node = make("path", { class: o.obstacle ? "obstacle" : "safe", "fill-rule": "evenodd" }, path.beneath);
      const name = o.endless ? null : make("text", { class: "name", "text-anchor": "middle" }, path.beneath);
      if (name) name.textContent = o.label;
      make("title", {}, node).textContent = o.label;
      return (t) => {
        const [x, y] = between(o.centre[0], o.centre.slice(1), t);
        const rings = o.rings.map((ring) => ring.map((c) => [path.X(x + c[0]), path.Y(y + c[1])]));
        const line = (ring) => `M${ring.map((c) => c.map((v) => v.toFixed(1)).join(" ")).join("L")}Z`;
        node.setAttribute("d", rings.map(line).join(""));
        if (name) {
          const [across, down] = [0, 1].map((i) => rings.flat().map((c) => c[i]));
          const top = Math.min(...down), large = Math.max(...down) - top > 150;
          // Above a shape, so that a vehicle in it is seen; within a large one.
          name.setAttribute("x", large ? across[down.indexOf(top)] : (Math.max(...across) + Math.min(...across)) / 2);
          name.setAttribute("y", large ? top + 16 : top - 4);
          // Where there are many, only those with room.
          const room = scene.outlines.length <= 12 || Math.max(...across) - Math.min(...across) > 6 * o.label.length;
          name.setAttribute("visibility", room ? "visible" : "hidden");
        }
      };
    };
    const vehicle = (v, i) => {
      const trail = make("path", { class: "trail", stroke: colour(i) }, path.above);
      const node = make("path", { class: "vehicle", fill: colour(i),
        d: v.heading.length ? "M13 0L-8 8L-4 0L-8 -8Z" : "M7 0A7 7 0 1 1 -7 0A7 7 0 1 1 7 0Z" }, path.above);
      make("title", {}, node).textContent = v.label;
      const point = (x, y) => `${path.X(x).toFixed(1)} ${path.Y(y).toFixed(1)}`;
      return (t) => {
        const until = before(v.time, t), [x, y] = between(v.time, [v.x, v.y], t);
        let d = "", pen = false;
        for (let k = 0; k <= until; k++) {
          const there = v.x[k] !== null && v.y[k] !== null;
          if (there) d += (pen ? "L" : "M") + point(v.x[k], v.y[k]);
          pen = there;
        }
        const there = Number.isFinite(x) && Number.isFinite(y);
        trail.setAttribute("d", d + (pen && there ? "L" + point(x, y) : ""));
        node.setAttribute("visibility", there ? "visible" : "hidden");
        if (!there) return;
        const turn = v.heading.length ? (-180 / Math.PI) * between(v.time, [v.heading], t)[0] : 0;
        node.setAttribute("transform", `translate(${point(x, y)}) rotate(${turn.toFixed(1)})`);
      };
    };
    let parts = [];
    const draw = () => {
      path.beneath = make("g", {});
      path.inner.prepend(path.beneath);
      path.above = make("g", { "pointer-events": "none" }, path.inner);
      parts = [...scene.outlines.map(outline), ...scene.vehicles.map(vehicle)];
      for (const move of parts) move(time);
    };
    path.after.push(draw);
    draw();
    movers.push((t) => { for (const move of parts) move(t); });
  }

  // Space, as seen from a direction that dragging turns.
  const holder = document.querySelector(".space");
  if (holder) {
    const flyers = scene.vehicles.filter((v) => v.z.length);
    const reach = [0, 1, 2].map((axis) => {
      const paths = flyers.flatMap((v) => [v.x, v.y, v.z][axis]).filter(Number.isFinite);
      const solids = scene.solids.filter((s) => axis < 2 || s.round !== 2);
      const sides = solids.flatMap((s) => [s.centre[axis] - s.size[axis], s.centre[axis] + s.size[axis]]);
      const all = [...paths, ...sides, ...(axis === 2 ? [0] : [])];
      return [all.reduce((a, b) => Math.min(a, b), Infinity), all.reduce((a, b) => Math.max(a, b), -Infinity)];
    });
    const middle = reach.map(([low, high]) => (low + high) / 2);
    const radius = Math.hypot(...reach.map(([low, high]) => (high - low) / 2)) || 1;
    const W = 720, H = 480, per = H / (2.1 * radius);
    const svg = make("svg", { viewBox: `0 0 ${W} ${H}`, role: "img", "aria-label": "the paths in space" }, holder);
    let azimuth = -0.9, elevation = 0.5;
    // On the screen: to the right, down, and how near.
    const seen = (p) => {
      const [x, y, z] = p.map((v, i) => v - middle[i]);
      const [s, c, t, u] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
      const right = -s * x + c * y, back = c * x + s * y;
      return [W / 2 + per * right, H / 2 - per * (u * z - t * back), u * back + t * z];
    };
    const line = (points, closed) => {
      const all = points.map((p) => seen(p).slice(0, 2).map((v) => v.toFixed(1)).join(" "));
      return all.length ? `M${all.join("L")}${closed ? "Z" : ""}` : "";
    };
    const ring = (f) => Array.from({ length: 49 }, (_, k) => f(Math.cos((2 * Math.PI * k) / 48), Math.sin((2 * Math.PI * k) / 48)));
    const faces = (s) => {
      const [a, b] = [Math.cos(s.angle), Math.sin(s.angle)];
      const at = (i, j, k) => [s.centre[0] + a * i * s.size[0] - b * j * s.size[1], s.centre[1] + b * i * s.size[0] + a * j * s.size[1], s.centre[2] + k * s.size[2]];
      if (s.round === 3) {
        const [x, y, z] = s.centre, r = s.size[0], [p, q] = [Math.cos(azimuth), Math.sin(azimuth)], [t, u] = [Math.sin(elevation), Math.cos(elevation)];
        // Its outline faces the viewer; the equator shows its turn.
        return [ring((c, d) => [x - r * (q * c + t * p * d), y + r * (p * c - t * q * d), z + r * u * d]), ring((c, d) => [x + r * c, y + r * d, z])];
      }
      if (s.round === 2) {
        const [x, y] = s.centre, r = s.size[0], [low, high] = reach[2];
        const [c, d] = [-Math.sin(azimuth), Math.cos(azimuth)];
        const side = [[1, low], [1, high], [-1, high], [-1, low]].map(([e, z]) => [x + e * r * c, y + e * r * d, z]);
        return [side, ...[low, high].map((z) => ring((e, f) => [x + r * e, y + r * f, z]))];
      }
      const six = [0, 1, 2].flatMap((axis) => [-1, 1].map((sign) => [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([i, j]) => {
        const corner = [i, j];
        corner.splice(axis, 0, sign);
        return at(...corner);
      })));
      return six;
    };
    let movers3 = [];
    const draw = () => {
      svg.textContent = "";
      const [[x0, x1], [y0, y1]] = reach;
      make("path", { class: "floor", d: line([[x0, y0, reach[2][0]], [x1, y0, reach[2][0]], [x1, y1, reach[2][0]], [x0, y1, reach[2][0]]], true) }, svg);
      for (const [name, p] of [["x", [x1, y0, reach[2][0]]], ["y", [x0, y1, reach[2][0]]]]) {
        const [across, down] = seen(p);
        make("text", { class: "name", x: across, y: down + 14, "text-anchor": "middle" }, svg).textContent = name;
      }
      // What is far first.
      for (const s of [...scene.solids].sort((a, b) => seen(a.centre)[2] - seen(b.centre)[2])) {
        const node = make("path", { class: s.obstacle ? "obstacle" : "safe", d: faces(s).map((f) => line(f, true)).join("") }, svg);
        make("title", {}, node).textContent = s.label;
        const [across, down] = seen([s.centre[0], s.centre[1], s.round === 2 ? reach[2][1] : s.centre[2] + s.size[2]]);
        make("text", { class: "name", x: across, y: down - 5, "text-anchor": "middle" }, svg).textContent = s.label;
      }
      movers3 = flyers.map((v) => {
        const hue = colour(scene.vehicles.indexOf(v)), points = v.x.map((x, k) => [x, v.y[k], v.z[k]]).filter((p) => p.every(Number.isFinite));
        make("path", { class: "shadow", d: line(points.map(([x, y]) => [x, y, reach[2][0]])) }, svg);
        make("path", { class: "trail", stroke: hue, opacity: 0.4, d: line(points) }, svg);
        const trail = make("path", { class: "trail", stroke: hue }, svg), drop = make("path", { class: "shadow" }, svg);
        const node = make("circle", { class: "vehicle", r: 7, fill: hue }, svg);
        make("title", {}, node).textContent = v.label;
        return (t) => {
          const at = between(v.time, [v.x, v.y, v.z], t), until = before(v.time, t);
          if (!at.every(Number.isFinite)) return;
          trail.setAttribute("d", line([...points.slice(0, until + 1), at]));
          drop.setAttribute("d", line([at, [at[0], at[1], reach[2][0]]]));
          const [across, down] = seen(at);
          node.setAttribute("cx", across);
          node.setAttribute("cy", down);
        };
      });
      for (const move of movers3) move(time);
    };
    let from = null;
    svg.addEventListener("pointerdown", (event) => { from = [event.clientX, event.clientY, azimuth, elevation]; svg.setPointerCapture(event.pointerId); });
    svg.addEventListener("pointermove", (event) => {
      if (!from) return;
      azimuth = from[2] - (event.clientX - from[0]) / 150;
      elevation = Math.min(1.5, Math.max(-0.2, from[3] + (event.clientY - from[1]) / 150));
      draw();
    });
    for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => { from = null; });
    draw();
    movers.push((t) => { for (const move of movers3) move(t); });
  }

  // A chart over time: a cursor, and a click that moves the time there.
  const cursor = (view) => {
    let line;
    const move = (t) => {
      const x = view.X(t), { left, width } = view.area;
      line.setAttribute("x1", x);
      line.setAttribute("x2", x);
      line.setAttribute("visibility", x >= left - 0.5 && x <= left + width + 0.5 ? "visible" : "hidden");
    };
    const draw = () => {
      const { top, height } = view.area;
      line = make("line", { class: "now", y1: top, y2: top + height }, view.svg);
      move(time);
    };
    view.after.push(draw);
    draw();
    movers.push(move);
    let down = null;
    view.svg.addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY]; });
    view.svg.addEventListener("click", (event) => {
      // The end of a drag is no click.
      if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) > 5) return;
      show(view.at(event)[0]);
    });
  };
  const readings = [];
  for (const holder of document.querySelectorAll(".over-time")) {
    const view = views.get(holder.dataset.chart);
    cursor(view);
    for (const c of view.curves) {
      if (!c.label) continue;
      const node = document.createElement("span"), swatch = document.createElement("i"), value = document.createElement("b");
      swatch.style.background = colour(c.colour);
      node.append(swatch, `${c.label} `, value);
      readings.push([node, (t) => {
        const y = c.style === "steps" ? c.y[before(c.x, t)] : between(c.x, [c.y], t)[0];
        value.textContent = Number.isFinite(y) ? short(y) : "–";
      }]);
    }
  }

  // The status over time, in the columns of the charts below.
  for (const [key, strip] of scene.strips) {
    const holder = document.querySelector(`[data-strip="${key}"]`);
    const beside = views.get(holder.nextElementSibling?.dataset.chart);
    if (!beside) continue;
    const svg = make("svg", { role: "img", "aria-label": "status over time" }, holder);
    const legend = document.createElement("p");
    legend.append(`${strip.label}: `);
    const word = document.createElement("span"), swatch = document.createElement("i"), text = document.createElement("b");
    word.append(swatch, `${strip.label} `, text);
    for (const [name, hue] of strip.words) {
      const entry = document.createElement("span"), mark = document.createElement("i");
      mark.style.background = colour(hue);
      entry.append(mark, name);
      legend.append(entry);
    }
    holder.append(legend);
    const starts = strip.parts.map((p) => p[0]);
    let line, X;
    const move = (t) => {
      line.setAttribute("x1", X(t));
      line.setAttribute("x2", X(t));
      const [name, hue] = strip.words[strip.parts[before(starts, t)][1]];
      text.textContent = name;
      swatch.style.background = colour(hue);
    };
    const draw = () => {
      const { left, width } = beside.area, range = [beside.X(first), beside.X(last)];
      X = (t) => range[0] + ((t - first) / (last - first || 1)) * (range[1] - range[0]);
      svg.textContent = "";
      svg.setAttribute("viewBox", `0 0 ${left + width + 12} 22`);
      const box = make("clipPath", { id: `clip-${key}` }, make("defs", {}, svg));
      make("rect", { x: left, y: 0, width, height: 22 }, box);
      const inner = make("g", { "clip-path": `url(#clip-${key})` }, svg);
      strip.parts.forEach(([from, index], i) => {
        const to = i + 1 < starts.length ? starts[i + 1] : last;
        const part = make("rect", { x: X(from), y: 2, width: Math.max(0.5, X(to) - X(from)), height: 18, fill: colour(strip.words[index][1]) }, inner);
        make("title", {}, part).textContent = `${strip.words[index][0]}: ${short(from)} s to ${short(to)} s`;
      });
      line = make("line", { class: "now", y1: 0, y2: 22 }, inner);
      move(time);
    };
    beside.after.push(draw);
    draw();
    movers.push(move);
    now.append(word);
  }

  now.append(...readings.map(([node]) => node));
  const show = (t) => {
    time = Math.min(last, Math.max(first, t));
    slider.value = time;
    clock.textContent = `${time.toFixed(2)} s`;
    slider.setAttribute("aria-valuetext", clock.textContent);
    for (const move of movers) move(time);
    for (const [, read] of readings) read(time);
  };
  let frame = null;
  const stop = () => {
    if (frame !== null) cancelAnimationFrame(frame);
    frame = null;
    play.textContent = "\u25b6";
    play.setAttribute("aria-label", "play");
  };
  const start = () => {
    if (time >= last) show(first);
    let at = null;
    const step = (instant) => {
      if (at !== null) show(time + ((instant - at) / 1000) * ((last - first) / length));
      at = instant;
      if (time >= last) stop(); else frame = requestAnimationFrame(step);
    };
    frame = requestAnimationFrame(step);
    play.textContent = "\u275a\u275a";
    play.setAttribute("aria-label", "pause");
  };
  const toggle = () => (frame === null ? start() : stop());
  play.addEventListener("click", toggle);
  slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
  slider.addEventListener("keydown", (event) => {
    if (event.key === " ") { event.preventDefault(); toggle(); }
  });
  show(first);
})();
