/* The live figure of a block's page: its experiment, repeated with other parameters. */
(function (live) {
  "use strict";
  const { element } = live;
  const NUMBERS = 8; /* sliders that are shown at once */

  function unpacked(value) {
    if (typeof value === "number") return value;
    const text = atob(value);
    return new Float64Array(Uint8Array.from(text, (character) => character.charCodeAt(0)).buffer);
  }

  const column = (given, rows) => (typeof given === "number" ? new Float64Array(rows).fill(given) : given);
  const mapped = (object, call) => Object.fromEntries(Object.entries(object).map(([name, each]) => [name, call(each, name)]));

  /* Repeat a recorded run; return its columns: time, inputs and outputs. */
  function repeat(run, values, { step, steps, inputs, outputs }) {
    const columns = mapped(inputs, (given) => column(given, steps + 1));
    const taken = Object.fromEntries(Object.entries(columns).filter(([name]) => run.takes(name)).map(([name, given]) =>
      [name, run.model.variables.get(name).type === "Boolean" ? Array.from(given, (each) => each !== 0) : given]));
    run.begin(values);
    if (typeof step === "number") return { ...columns, ...run.advance(step, steps, taken, outputs) };
    const parts = Array.from(step, (length, i) => run.advance(length, 1, mapped(taken, (given) => given.slice(i, i + 2)), outputs));
    return { ...columns, ...mapped(parts[0], (first, name) => Float64Array.of(first[0], ...parts.map((part) => part[name][1]))) };
  }

  /* Return the figures of a block, and the force of a law if none of them shows it. */
  function withForce(figures, model) {
    const force = model.variables.get("u");
    const shown = figures.some(({ curves }) => curves.some(({ y }) => y.name === "u"));
    if (!force || force.causality !== "output" || shown) return figures;
    const [{ runs }] = figures;
    const all = (name) => ({ name, from: 0, count: runs[0].steps + 1 });
    const curves = [{ x: all("time"), y: all("u"), run: 0, label: "", aside: false }];
    return [...figures, { x: ["time", "s"], y: ["u", force.unit || ""], caption: "Output in this motion", curves, runs: [{ ...runs[0], outputs: ["u"] }] }];
  }

  /* Return a view, as the lab has them, that repeats recorded runs. */
  function repeated(figures) {
    const runs = figures.map((figure) => figure.runs.map((run) => ({ ...run, step: unpacked(run.step), inputs: mapped(run.inputs, unpacked) })));
    return {
      controls: [],
      charts: figures.map(({ x, y, caption }) => ({ title: caption.replace(/\.$/, ""), x, y })),
      compute(run, values) {
        const charts = figures.map((figure, k) => {
          const found = runs[k].map((each) => repeat(run, values, each));
          const at = (place, { run: number, x, y }) => {
            if (place.name) return found[number][place.name].slice(place.from, place.from + place.count);
            return column(unpacked(place), (x.count || y.count));
          };
          return figure.curves.map((curve) => ({ x: at(curve.x, curve), y: at(curve.y, curve), label: curve.label, aside: curve.aside }));
        });
        return { charts, text: "" };
      },
    };
  }

  async function show(box) {
    const name = box.dataset.block;
    const run = new live.Run(await live.load(name));
    const about = run.about;
    const view = about.figures ? repeated(withForce(about.figures, run.model)) : live.views.find(({ id }) => id === "contact");
    const setup = Object.fromEntries(view.controls.map(({ name: key, start }) => [key, start]));
    if (about.reach) {
      const scales = { fastest: about.speed, amplitude: 0.6 * about.reach, speed: about.speed / 100 };
      for (const [key, scale] of Object.entries(scales)) setup[key] = Number(scale.toPrecision(2));
    }
    const shown = [...run.model.variables.values()].filter(
      ({ causality, start, name: each }) => causality === "parameter" && start !== undefined && isFinite(start) && each !== "Ts");
    const values = Object.fromEntries(shown.map(({ name: each, start }) => [each, start]));
    const typical = (unit) => Math.max(0, ...shown.filter((each) => each.unit === unit).map((each) => Math.abs(each.start)));
    const rare = ({ name: each, type }) => /\[|_neg$|0$|^seed$|^dt$/.test(each) || type === "Boolean";
    const ordered = [...shown.filter((each) => !rare(each)), ...shown.filter(rare)];
    const rows = ordered.map((variable) => {
      const { unit = "", description = "", min = -Infinity, max = Infinity, type } = variable;
      const told = { name: variable.name, text: description, unit, start: Number(variable.start), min, max, type };
      return live.slider({ ...told, ...live.rangeOf(told, typical(unit)), accepts: live.limits(told) }, (key, value) => {
        values[key] = type === "Boolean" ? value !== 0 : value;
        redraw();
      }).element;
    });
    const count = Math.min(NUMBERS, ordered.filter((each) => !rare(each)).length);
    const more = rows.slice(count);
    const motion = view.controls.map((each) => live.slider({ ...each, start: setup[each.name] }, (key, value) => {
      setup[key] = value;
      redraw();
    }).element);
    const others = [...more, ...motion];
    const figures = element("div", { className: "figures" });
    const result = element("p", { className: "caption", role: "status" });
    box.replaceChildren(figures, element("section", { className: "controls", "aria-label": "Parameters of " + name }, ...rows.slice(0, count),
      ...(others.length ? [element("details", {}, element("summary", {}, "More"), ...others)] : [])));
    const charts = view.charts.map((each) => live.chart(figures.appendChild(element("figure")), each));
    figures.append(result);

    function draw() {
      try {
        const found = view.compute(run, values, setup);
        found.charts.forEach((curves, k) => charts[k].draw(curves.map((curve) => ({ ...curve, role: curve.aside ? "aside" : "first" }))));
        result.textContent = found.text && name + " " + found.text + ".";
      } catch (error) {
        result.textContent = name + " does not run with these values: " + error.message;
      }
    }
    const redraw = live.redrawing(draw, result);
    draw();
    live.onTheme(() => charts.forEach((chart) => chart.redraw()));
    box.dataset.ready = name;
  }

  for (const box of document.querySelectorAll(".live-block")) {
    show(box).catch((error) => box.append(element("p", { role: "alert" }, error.message)));
  }
})(FrictionLive);
