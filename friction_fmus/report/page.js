// Draws the plots of the page: colours of the dark mode, legends and zoom accessible by keyboard, and printing.
"use strict";
(async () => {
  const PRINT = { width: 660, curves: 340, bars: 860 }; // px; two plots of curves, or one of bars, fit on A4 and letter
  const DARK = { "#222222": "#e9e9e9", "#ffffff": "#15181c", "#dddddd": "#3a4047", "#8a8a8a": "#8f969d", "#0072B2": "#3d9bd6" };
  const MARKS = { // shapes of the legend, 34 px by 12 px, as in the plots
    square: "M13.5 2.5h7v7h-7z",
    diamond: "M17 1.5l4.5 4.5-4.5 4.5-4.5-4.5z",
    "triangle-up": "M17 2l4.5 8h-9z",
    "triangle-down": "M17 10l4.5-8h-9z",
    cross: "M15.5 2h3v2.5h2.5v3h-2.5v2.5h-3v-2.5h-2.5v-3h2.5z",
    x: "M14 2l3 2.5 3-2.5 1.5 1.5-2.5 2.5 2.5 2.5-1.5 1.5-3-2.5-3 2.5-1.5-1.5 2.5-2.5-2.5-2.5z",
    star: "M17 1l1.5 3.5 3.5.5-2.5 2.5.5 3.5-3-2-3 2 .5-3.5-2.5-2.5 3.5-.5z",
  };
  const boxes = [...document.querySelectorAll(".plot")];
  const dark = window.matchMedia("(prefers-color-scheme: dark)");

  // the library is stored compressed; the content security policy allows exactly this text as a script
  const packed = Uint8Array.from(atob(document.getElementById("library").textContent), (c) => c.charCodeAt(0));
  const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const library = document.createElement("script");
  library.textContent = await new Response(unpacked).text();
  document.head.append(library);

  const colour = (name, light) => (light || !dark.matches ? name : DARK[name] ?? name);

  function numbers(column) {
    if (!column || !column.bdata) return column;
    const bytes = Uint8Array.from(atob(column.bdata), (c) => c.charCodeAt(0));
    return new Float32Array(bytes.buffer);
  }

  function figure(box, light) {
    const text = document.getElementById(box.id + "-data").textContent;
    const recoloured = text.replace(/"(#[0-9a-fA-F]{6})"/g, (_, name) => `"${colour(name, light)}"`);
    const { data, layout } = JSON.parse(recoloured);
    for (const trace of data) Object.assign(trace, { x: numbers(trace.x), y: numbers(trace.y) });
    layout.dragmode = window.matchMedia("(pointer: coarse)").matches ? false : "zoom"; // a finger scrolls the page
    return { data, layout };
  }

  // keep hidden curves hidden and zoomed axes zoomed
  function redraw(box, light) {
    const { data, layout } = figure(box, light);
    data.forEach((trace, i) => (trace.visible = box.data[i].visible));
    for (const key of Object.keys(box.layout).filter((name) => /^[xy]axis/.test(name))) {
      layout[key].range = [...box.layout[key].range];
    }
    Plotly.react(box, data, layout);
    legend(box, light);
  }

  function legend(box, light) {
    const list = document.getElementById(box.id + "-legend");
    if (!list) return;
    const names = [...new Set(box.data.map((trace) => trace.meta))]; // a curve may be in two panels
    list.replaceChildren(
      ...names.map((name) => {
        const places = box.data.flatMap((trace, i) => (trace.meta === name ? [i] : []));
        const trace = box.data[places[0]];
        const button = document.createElement("button");
        const sample = document.createElement("span");
        button.type = "button";
        button.setAttribute("aria-pressed", String(trace.visible !== "legendonly"));
        sample.innerHTML = swatch(trace, light);
        button.append(sample, trace.meta);
        button.addEventListener("click", () => {
          const seen = box.data[places[0]].visible !== "legendonly";
          Plotly.restyle(box, { visible: seen ? "legendonly" : true }, places);
          button.setAttribute("aria-pressed", String(!seen));
        });
        return button;
      }),
    );
  }

  function swatch(trace, light) {
    const line = trace.mode.includes("lines")
      ? `<line x1="0" y1="6" x2="34" y2="6" stroke="${trace.line.color}" stroke-width="2.4"
           stroke-dasharray="${trace.line.dash && trace.line.dash !== "solid" ? trace.line.dash.replaceAll("px", "") : "none"}"/>`
      : "";
    const colours = `fill="${trace.marker?.color}" stroke="${(trace.marker?.line ?? trace.marker)?.color}"`;
    const mark = !trace.mode.includes("markers")
      ? ""
      : MARKS[trace.marker.symbol]
        ? `<path d="${MARKS[trace.marker.symbol]}" ${colours}/>`
        : `<circle cx="17" cy="6" r="3.5" ${colours}/>`;
    return `<svg width="34" height="12" aria-hidden="true">${line}${mark}</svg>`;
  }

  // fit the vertical axis to the visible part of the curves
  function show(box, begin, end) {
    let [low, high] = [Infinity, -Infinity];
    for (const trace of box.data) {
      if (trace.visible === "legendonly") continue;
      trace.x.forEach((x, i) => {
        if (x >= begin && x <= end) [low, high] = [Math.min(low, trace.y[i]), Math.max(high, trace.y[i])];
      });
    }
    const change = { "xaxis.range": [begin, end] };
    if (low < high) change["yaxis.range"] = [low - 0.05 * (high - low), high + 0.05 * (high - low)];
    Plotly.relayout(box, change);
  }

  function press(button) {
    const box = document.getElementById(button.dataset.plot);
    const { begin, end, zoom, move } = button.dataset;
    if (begin !== undefined) return show(box, Number(begin), Number(end));
    if (zoom === undefined && move === undefined) {
      return Plotly.relayout(box, { "xaxis.autorange": true, "yaxis.autorange": true });
    }
    const [left, right] = box.layout.xaxis.range;
    const half = 0.5 * (right - left) * Number(zoom ?? 1);
    const centre = 0.5 * (left + right) + Number(move ?? 0) * (right - left);
    return show(box, centre - half, centre + half);
  }

  for (const box of boxes) {
    const { data, layout } = figure(box, false);
    box.style.height = box.dataset.height + "px";
    await Plotly.newPlot(box, data, layout, {
      responsive: true,
      displaylogo: false,
      displayModeBar: false,
      doubleClick: "reset",
    });
    legend(box, false);
  }
  for (const button of document.querySelectorAll(".tools button")) {
    button.disabled = false;
    button.addEventListener("click", () => press(button));
  }
  for (const folded of document.querySelectorAll("details")) {
    folded.addEventListener("toggle", () => {
      if (folded.open) folded.querySelectorAll(".plot").forEach((box) => Plotly.Plots.resize(box));
    });
  }
  dark.addEventListener("change", () => boxes.forEach((box) => redraw(box, false)));

  window.addEventListener("beforeprint", () => {
    for (const box of boxes) {
      redraw(box, true);
      const height = document.getElementById(box.id + "-legend") ? PRINT.curves : PRINT.bars;
      Plotly.relayout(box, { width: PRINT.width, height: Math.min(box.layout.height, height) });
    }
  });
  window.addEventListener("afterprint", () => {
    for (const box of boxes) {
      redraw(box, false);
      Plotly.Plots.resize(box);
    }
  });
  document.documentElement.dataset.plots = "drawn";
})().catch((error) => {
  console.error(error);
  for (const box of document.querySelectorAll(".plot")) {
    box.classList.add("missing");
    box.textContent = "This plot needs a browser released in 2023 or later; the tables have its values.";
  }
});
