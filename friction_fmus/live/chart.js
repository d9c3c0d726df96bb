/* Charts of curves, drawn by uPlot: colours that everyone can tell apart, and dashes for those who see none. */
(function (live) {
  "use strict";
  const { element, readable, spaced } = live;
  const WIDTHS = { first: 2, second: 2, aside: 1.5, measured: 4 };
  const DASHES = { first: [], second: [7, 4], aside: [2, 3], measured: [] };

  /* Return a function that returns a colour of the page by name; an element resolves `light-dark`. */
  function colours(box) {
    const probe = box.querySelector(".area");
    return (name) => {
      probe.style.color = "var(--live-" + name + ")";
      return getComputedStyle(probe).color;
    };
  }

  /* Return the range of values that contains the data: the one shown, unless it is too small or much too large. */
  function range(shown, low, high, factor) {
    const size = high - low || Math.abs(high) || 1;
    const fits = shown && shown[0] <= low && high <= shown[1] && size > 0.35 * (shown[1] - shown[0]);
    return fits && shown.factor === factor ? shown : Object.assign([low - 0.06 * size, high + 0.06 * size], { factor });
  }

  /* Draw the points of a curve as a line; they need not be in the order of x. */
  function line(u, index) {
    const [xs, ys] = u.data[index];
    const path = new Path2D();
    let pen = false;
    for (let i = 0; i < xs.length; i++) {
      if (ys[i] === null || !isFinite(ys[i])) {
        pen = false;
        continue;
      }
      const x = u.valToPos(xs[i], "x", true);
      const y = u.valToPos(ys[i], "y", true);
      if (pen) path.lineTo(x, y);
      else path.moveTo(x, y);
      pen = true;
    }
    return { stroke: path, fill: null, clip: null, band: null, gaps: null, flags: 0 };
  }

  /* Make a chart in a box. `about`: title, name and unit of x and y, and element of the heading. */
  function chart(box, about) {
    const title = element(about.heading || "h2", {}, about.title);
    const legend = element("p", { className: "legend" });
    const area = element("div", { className: "area", role: "img", "aria-label": about.title });
    const place = element("output", { className: "place", "aria-live": "off" });
    box.append(element("div", { className: "head" }, title, legend, place), area);
    let plot, shape, shown = {}, last;

    function axis(side, name, unit) {
      return {
        scale: side === 0 || side === 2 ? "x" : "y",
        side,
        label: name + (unit ? " [" + spaced(unit) + "]" : ""),
        labelSize: 18,
        size: side === 3 ? 46 : 20,
        gap: 3,
        font: "12px system-ui, sans-serif",
        labelFont: "12px system-ui, sans-serif",
        stroke: () => colours(box)("text"),
        grid: { stroke: () => colours(box)("grid"), width: 1 },
        ticks: { show: false },
        values: (u, splits) => splits.map((value) => Number(value.toPrecision(6)).toString().replace("-", "\u2212")),
      };
    }

    function make(curves, units, data) {
      if (plot) plot.destroy();
      plot = new uPlot(
        {
          mode: 2,
          width: Math.max(area.clientWidth, 120),
          height: Math.max(area.clientHeight, 120),
          padding: [8, 10, 0, 0],
          legend: { show: false },
          cursor: { drag: { x: false, y: false }, points: { show: false }, dataIdx: () => null },
          scales: { x: { time: false, auto: false, range: () => shown.x }, y: { auto: false, range: () => shown.y } },
          axes: [axis(2, about.x[0], units[0]), axis(3, about.y[0], units[1])],
          series: [
            {},
            ...curves.map((curve) => ({
              scale: "y",
              facets: [{ scale: "x", auto: false }, { scale: "y", auto: false }],
              stroke: () => colours(box)(curve.role),
              width: WIDTHS[curve.role],
              dash: DASHES[curve.role],
              points: { show: false },
              paths: line,
            })),
          ],
          hooks: {
            setCursor: [
              (u) => {
                const inside = u.cursor.left >= 0;
                const at = (value) => Number(value.toPrecision(4)).toString();
                place.textContent = inside
                  ? at(u.posToVal(u.cursor.left, "x")) + " " + units[0] + ", " + at(u.posToVal(u.cursor.top, "y")) + " " + units[1]
                  : "";
              },
            ],
          },
        },
        data,
        area,
      );
      legend.replaceChildren(
        ...[...new Map(curves.map((curve) => [curve.label, curve.role])).entries()]
          .filter(([label]) => label)
          .map(([label, role]) => element("span", { className: "entry " + role }, element("i", {}), label)),
      );
    }

    /* Draw curves, each with x, y, label and role: first, second, aside or measured. */
    function draw(curves) {
      last = curves;
      const bounds = { x: [Infinity, -Infinity], y: [Infinity, -Infinity] };
      for (const curve of curves) {
        for (const key of ["x", "y"]) {
          for (const value of curve[key]) {
            if (value < bounds[key][0]) bounds[key][0] = value;
            if (value > bounds[key][1]) bounds[key][1] = value;
          }
        }
      }
      const most = (key) => Math.max(Math.abs(bounds[key][0]), Math.abs(bounds[key][1]));
      const [fx, ux] = readable(most("x"), about.x[1]);
      const [fy, uy] = readable(most("y"), about.y[1]);
      shown.x = range(shown.x, bounds.x[0] * fx, bounds.x[1] * fx, fx);
      shown.y = range(shown.y, bounds.y[0] * fy, bounds.y[1] * fy, fy);
      if (about.tight) shown.x = Object.assign([bounds.x[0] * fx, bounds.x[1] * fx], { factor: fx });
      const data = [null, ...curves.map((curve) => [curve.x.map((v) => v * fx), curve.y.map((v) => v * fy)])];
      const wanted = JSON.stringify([ux, uy, curves.map((curve) => [curve.role, curve.label])]);
      if (wanted !== shape) {
        make(curves, [ux, uy], data);
        shape = wanted;
      }
      plot.batch(() => {
        plot.setData(data);
        for (const key of ["x", "y"]) plot.setScale(key, { min: shown[key][0], max: shown[key][1] });
      });
      plot.redraw(true, true);
      const names = [...new Set(curves.map((curve) => curve.label).filter(Boolean))].join(", ");
      area.setAttribute("aria-label", about.title + (names ? ": " + names : ""));
    }

    new ResizeObserver(() => {
      if (plot && (plot.width !== area.clientWidth || plot.height !== area.clientHeight) && area.clientWidth) {
        plot.setSize({ width: area.clientWidth, height: area.clientHeight });
      }
    }).observe(area);
    return { draw, redraw: () => last && ((shape = null), draw(last)) };
  }

  /* Call a function when the colours of the page change. */
  function onTheme(call) {
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", call);
    new MutationObserver(call).observe(document.body, { attributes: true, attributeFilter: ["data-md-color-scheme"] });
  }

  const SLOW = 200; /* ms: a figure that takes longer is drawn when the slider rests for REST */
  const REST = 250;

  /* Return a function that asks for a redraw before the next frame, and measures the time from the first request. The
     sentence tells that a slow figure is being computed. */
  function redrawing(draw, sentence) {
    let asked = null, took = 0, timer;
    function now() {
      const begin = asked, computing = performance.now();
      asked = null;
      draw();
      took = performance.now() - computing;
      queueMicrotask(() => performance.measure("redraw", { start: begin, end: performance.now() }));
    }
    return () => {
      if (took > SLOW) {
        clearTimeout(timer);
        asked = performance.now();
        sentence.textContent = "Computing\u2026";
        timer = setTimeout(() => requestAnimationFrame(now), REST);
      } else if (asked === null) {
        asked = performance.now();
        requestAnimationFrame(now);
      }
    };
  }

  Object.assign(live, { chart, onTheme, redrawing });
})(FrictionLive);
