// Draws the runs over the two quantities that the reader chooses, and the arrivals at a barrier.
(() => {
  const bare = { title: "", equal: false, discs: [], verticals: [], horizontals: [] };
  const place = (key) => document.querySelector(`[data-chart="${key}"]`);

  if (scene.shown) {
    const chosen = ["across", "up"].map((id) => document.getElementById(id));
    const again = document.getElementById("again");
    const holder = place("runs");
    let view;
    const draw = () => {
      const [x, y] = chosen.map((select) => scene.axes[Number(select.value)]);
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
    for (const select of chosen) select.addEventListener("change", draw);
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
