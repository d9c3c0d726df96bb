/* The live figure of a block's page: its experiment, repeated with other parameters. */
(function (live) {
  "use strict";
  const { element } = live;
  const NOTHING = { controls: [], charts: [], compute: () => ({ charts: [], text: "" }) };
  const NUMBERS = 8; /* sliders that are shown at once */

  function unpacked(value) {
    if (typeof value === "number") return value;
    const text = atob(value);
    return new Float64Array(Uint8Array.from(text, (character) => character.charCodeAt(0)).buffer);
  }

  const column = (given, rows) => (typeof given === "number" ? new Float64Array(rows).fill(given) : given);
  const mapped = (object, call) => Object.fromEntries(Object.entries(object).map(([name, each]) => [name, call(each, name)]));

  /* Repeat a recorded run; return its columns: time, inputs and outputs. */
  function repeat(run, values, { step, steps, inputs, outputs, fixed }) {
    const columns = mapped(inputs, (given) => column(given, steps + 1));
    const taken = Object.fromEntries(Object.entries(columns).filter(([name]) => run.takes(name)).map(([name, given]) =>
      [name, run.model.variables.get(name).type === "Boolean" ? Array.from(given, (each) => each !== 0) : given]));
    run.begin({ ...values, ...fixed });
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

  /* Return a view, as the lab has them, that repeats recorded runs, after what another view shows. */
  function repeated(figures, before) {
    const runs = figures.map((figure) => figure.runs.map((run) => ({ ...run, step: unpacked(run.step), inputs: mapped(run.inputs, unpacked) })));
    return {
      controls: before.controls,
      charts: [...before.charts, ...figures.map(({ x, y, caption }) => ({ title: caption.replace(/\.$/, ""), x, y }))],
      compute(run, values, setup) {
        const first = before.compute(run, values, setup);
        const charts = figures.map((figure, k) => {
          const found = runs[k].map((each) => repeat(run, values, each));
          const at = (place, { run: number, x, y }) => {
            if (place.name) return found[number][place.name].slice(place.from, place.from + place.count);
            return column(unpacked(place), (x.count || y.count));
          };
          return figure.curves.map((curve) => ({ x: at(curve.x, curve), y: at(curve.y, curve), label: curve.label, aside: curve.aside }));
        });
        return { charts: [...first.charts, ...charts], text: first.text };
      },
    };
  }

  const limitsOf = ({ zero, min, ...about }) => live.limits({ ...about, min: zero ? 0 : min });

  /* Return sentences about the sliders: with what they begin, and which there are none of. */
  function notes(about, run, shown) {
    const begin = shown.filter(({ name }) => name in about.begin);
    const sides = run.has(live.SIDES) && shown.some(({ name }) => /_neg$/.test(name));
    const list = (names) => names.join(", ").replace(/, ([^,]*)$/, " and $1");
    const short = (names) => list([...new Set(names.map((name) => name.replace(/\[\d+\]$/, "")))]);
    return [
      begin.length ? "So that every slider has an effect, " + short(begin.map(({ name }) => name)) + (begin.length > 1 ? " do" : " does") + " not begin with the start value of the FMU." : "",
      sides ? "Changing a parameter with the suffix _neg switches " + live.SIDES + " on." : "",
      about.idle.length ? "Not shown, because " + (about.idle.length > 1 ? "they have" : "it has") + " no visible effect in these figures: " + list(about.idle) + "." : "",
    ].filter(Boolean);
  }

  async function show(box) {
    const name = box.dataset.block;
    const run = new live.Run(await live.load(name));
    const about = run.about;
    const view = about.reach
      ? repeated(about.figures, live.views.find(({ id }) => id === "contact"))
      : repeated(withForce(about.figures, run.model), NOTHING);
    const motions = view.controls.filter(({ name: each }) => !about.idle.includes(each));
    const setup = Object.fromEntries(view.controls.map(({ name: key, start }) => [key, start]));
    if (about.reach) {
      const scales = { fastest: about.speed, amplitude: 0.6 * about.reach, speed: about.speed / 100 };
      for (const [key, scale] of Object.entries(scales)) setup[key] = Number(scale.toPrecision(2));
    }
    const shown = [...run.model.variables.values()].filter(({ causality, start, name: each }) =>
      causality === "parameter" && start !== undefined && isFinite(start) && ![...about.idle, "Ts", live.SIDES].includes(each))
      .map((each) => (each.name in about.begin ? { ...each, start: about.begin[each.name] } : each));
    const values = Object.fromEntries(shown.map(({ name: each, start }) => [each, Number(start)]));
    const changed = {};
    const typical = (unit) => Math.max(0, ...shown.filter((each) => each.unit === unit).map((each) => Math.abs(each.start)));
    const ordered = [...shown.filter((each) => !live.isRare(each)), ...shown.filter(live.isRare)];
    const rows = ordered.map((variable) => {
      const { unit = "", description = "", min = -Infinity, max = Infinity, type } = variable;
      const told = { name: variable.name, text: description, unit, start: Number(variable.start), min, max, type };
      return live.row({ ...told, ...live.rangeOf(told, typical(unit)), accepts: live.limits(told) }, (key, value) => {
        if (value === values[key]) delete changed[key];
        else changed[key] = value;
        redraw();
      }).element;
    });
    const count = Math.min(NUMBERS, ordered.filter((each) => !live.isRare(each)).length);
    const more = rows.slice(count);
    const motion = motions.map((each) => live.row({ ...each, start: setup[each.name], accepts: limitsOf(each) }, (key, value) => {
      setup[key] = value;
      redraw();
    }).element);
    const others = [...more, ...motion];
    const figures = element("div", { className: "figures" });
    const result = element("p", { className: "caption", role: "status" });
    const about_sliders = notes(about, run, shown).map((text) => element("p", { className: "caption" }, text));
    box.replaceChildren(figures, element("section", { className: "controls", "aria-label": "Parameters of " + name }, ...rows.slice(0, count),
      ...(others.length ? [element("details", {}, element("summary", {}, "More"), ...others)] : []), ...about_sliders));
    const charts = view.charts.map((each) => live.chart(figures.appendChild(element("figure")), each));
    figures.append(result);

    function draw() {
      try {
        const found = view.compute(run, { ...values, ...live.sided(changed) }, setup);
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
