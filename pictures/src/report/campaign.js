// Draws the runs over the two quantities that the reader chooses, and the arrivals at a barrier.
(() => {
  const bare = { title: "", equal: false, discs: [], verticals: [], horizontals: [] };
  const place = (key) => document.querySelector(`[data-chart="${key}"]`);

  if (scene.shown) {
    const chosen = ["across", "up"].map((id) => document.getElementById(id));
    const again = document.getElementById("again");
    const holder = place("runs"), how = document.getElementById("how");
    let view;
    // The rate of success in each part of the plane, of the first runs: later ones are drawn for their failure.
    const cells = (x, y) => {
      const side = Math.max(3, Math.min(10, Math.round(Math.sqrt(scene.first / 10))));
      const parts = [x, y].map(({ values, logarithmic }) => {
        const [to, from] = logarithmic ? [(v) => Math.log10(Math.abs(v)), (p) => 10 ** p] : [(v) => v, (p) => p];
        const known = values.slice(0, scene.first).filter((v) => v !== null && Number.isFinite(to(v))).map(to);
        const low = known.reduce((a, b) => Math.min(a, b), Infinity), high = known.reduce((a, b) => Math.max(a, b), -Infinity);
        const width = (high - low) / side || 1;
        return { at: (k) => from(low + k * width), range: [from(low), from(low + side * width)],
          of: (v) => (v === null || !Number.isFinite(to(v)) ? -1 : Math.min(side - 1, Math.floor((to(v) - low) / width))) };
      });
      const counts = Array.from({ length: side * side }, () => [0, 0]);
      for (let i = 0; i < scene.first; i++) {
        const [column, row] = [parts[0].of(x.values[i]), parts[1].of(y.values[i])];
        if (column < 0 || row < 0) continue;
        counts[row * side + column][0] += 1;
        counts[row * side + column][1] += scene.good[i] ? 1 : 0;
      }
      const found = counts.map(([runs, good], k) => ({ runs, rate: good / runs, row: Math.floor(k / side), column: k % side }));
      const full = found.filter((c) => c.runs > 0), percent = (c) => `${Math.round(100 * c.rate)} %`;
      const axis = ({ label, logarithmic }, { range }) => ({ label, logarithmic, range });
      const middle = full.map((c) => [parts[0].at(c.column + 0.5), parts[1].at(c.row + 0.5)]);
      // Nothing but a place to point at.
      const curve = { label: "", x: middle.map((m) => m[0]), y: middle.map((m) => m[1]), style: "points", colour: 6, dots: false, ends: [],
        names: full.map((c) => `success in ${percent(c)} of ${c.runs} runs`) };
      const view = views.draw(holder, { ...bare, x: axis(x, parts[0]), y: axis(y, parts[1]), curves: [curve] });
      const draw = () => {
        view.inner.querySelector(".curve")?.remove();
        for (const c of full) {
          const [left, right] = [0, 1].map((k) => view.X(parts[0].at(c.column + k)));
          const [bottom, top] = [0, 1].map((k) => view.Y(parts[1].at(c.row + k)));
          const box = { x: left, y: top, width: right - left, height: bottom - top };
          views.make("rect", { ...box, class: "cell", fill: views.colour(0), "fill-opacity": 0.75 * c.rate }, view.inner);
          views.make("rect", { ...box, fill: views.colour(1), "fill-opacity": 0.75 * (1 - c.rate) }, view.inner);
          const lines = [[percent(c), 13, -2], [`of ${c.runs}`, 11, 12]];
          if (box.width < 40 || box.height < 30) lines.length = box.width < 30 || box.height < 14 ? 0 : 1;
          for (const [words, size, down] of lines) {
            views.make("text", { x: (left + right) / 2, y: (top + bottom) / 2 + (lines.length > 1 ? down : 4), "font-size": size,
              "text-anchor": "middle", fill: "var(--ink)" }, view.inner).textContent = words;
          }
        }
      };
      view.after.push(draw);
      draw();
    };
    const draw = () => {
      const [x, y] = chosen.map((select) => scene.axes[Number(select.value)]);
      if (how.value === "1") {
        again.hidden = true;
        cells(x, y);
        return;
      }
      const curve = (label, good, style) => {
        const kept = scene.runs.map((_, i) => i).filter((i) => scene.good[i] === good);
        const of = (list) => kept.map((i) => list[i]);
        return { label: `${label} (${kept.length})`, x: of(x.values), y: of(y.values), runs: of(scene.runs),
          names: kept.map((i) => `run ${scene.runs[i]}, ${label}`), style, colour: good ? 0 : 1, dots: false, ends: [] };
      };
      const axis = ({ label, logarithmic }) => ({ label, logarithmic, range: null });
      view = views.draw(holder, { ...bare, x: axis(x), y: axis(y), curves: [curve("success", true, "points"), curve("failure", false, "crosses")] });
      view.svg.addEventListener("click", (event) => {
        const found = view.nearest(event);
        if (!found) return;
        again.hidden = false;
        again.textContent = scene.again.join(found.c.runs[found.i]);
      });
    };
    for (const select of [...chosen, how]) select.addEventListener("change", draw);
    draw();
  }

  if (scene.arrivals.length) {
    const holder = place("arrivals"), said = document.getElementById("arrived"), chosen = document.getElementById("barrier");
    const draw = () => {
      const arrivals = scene.arrivals[chosen ? Number(chosen.value) : 0];
      said.textContent = arrivals.said;
      holder.hidden = !arrivals.chart;
      if (arrivals.chart) views.draw(holder, arrivals.chart);
    };
    chosen?.addEventListener("change", draw);
    draw();
  }
})();
