/* The page of the lab: choices, sliders, charts, and what they share. */
(function (live) {
  "use strict";
  const { element, share } = live;
  const lab = document.getElementById("lab");
  const ROLES = ["first", "second"];
  const runs = new Map();
  let state, view, charts, results, broken = false;

  /* ---- the frame --------------------------------------------------------------------------------------------- */

  const presets = element("select", { id: "preset" }, element("option", { value: "" }, "choose an effect"),
    ...live.presets.map(({ id, title }) => element("option", { value: id }, title)));
  const views = element("select", { id: "view" }, ...live.views.map(({ id, title }) => element("option", { value: id }, title)));
  const names = ROLES.map((role) => element("select", { id: "model-" + role }));
  const claim = element("div", { className: "claim" });
  const text = element("p", { className: "about-view" });
  const result = element("p", { className: "result", role: "status" });
  const drawn = element("div", { className: "charts" });
  const drop = element("div", { className: "drop" });
  const controls = element("div", { className: "controls" });
  const papers = element("div", { className: "papers" });
  const exported = element("div", { className: "exported" });
  const field = (label, input) => element("label", { htmlFor: input.id }, label, " ", input);

  lab.replaceChildren(
    element("div", { className: "choices" }, field("Effect", presets), field("Experiment", views),
      field("Model", names[0]), field("compared with", names[1])),
    claim,
    text,
    element("div", { className: "bench" },
      element("div", { className: "shown" }, drop, drawn, result),
      element("section", { className: "controls-box", "aria-label": "Parameters" }, controls)),
    element("section", { "aria-label": "Equations and sources" }, papers),
    element("section", { "aria-label": "Copy" }, exported),
  );

  /* ---- models and values ------------------------------------------------------------------------------------- */

  const scriptOf = (name) => (view.part === "block" ? name : name + "-" + view.part);
  const possible = (name) => view.part === "block" || live.catalogue.onMass.includes(name);

  /* Return an instance for a side of the comparison; each side has its own, as both may have the same model. */
  async function runOf(side) {
    const key = side + scriptOf(state.models[side]);
    if (!runs.has(key)) runs.set(key, new live.Run(await live.load(scriptOf(state.models[side]))));
    return runs.get(key);
  }

  const prefix = () => (view.part === "block" ? "" : "friction.");

  /* Return the parameters of the friction model: those that are often changed, and the others. */
  function parametersOf(run) {
    const own = [...run.model.variables.values()].filter(
      ({ name, causality, start }) => causality === "parameter" && name.startsWith(prefix()) && name !== prefix() + live.SIDES && start !== undefined && isFinite(start),
    );
    const rare = ({ name, type }) => live.isRare({ name: name.slice(prefix().length), type });
    return { main: own.filter((each) => !rare(each)), more: own.filter(rare) };
  }

  function typicalOf(unit, variables) {
    return Math.max(0, ...variables.filter((each) => each.unit === unit && isFinite(each.start)).map((each) => Math.abs(each.start)));
  }

  function valuesOf(side) {
    return Object.fromEntries(Object.entries(live.sided(state[ROLES[side]])).map(([name, value]) => [prefix() + name, value]));
  }

  /* Return the values of the experiment: those that were set, else its start values. */
  function setup() {
    return Object.fromEntries(view.controls.map(({ name, start }) => [name, state.setup[name] ?? startOf(name, start)]));
  }

  /* The scales of a motion follow the first model, unless they are set. */
  function startOf(name, start) {
    const about = live.about[state.models[0]] || {};
    if (view.id !== "contact" || !about.reach) return start;
    const scales = { fastest: about.speed, amplitude: 0.6 * about.reach, speed: about.speed / 100 };
    return name in scales ? Number(scales[name].toPrecision(2)) : start;
  }

  /* Remove values, from an address, of names that do not exist or out of limits. */
  function known(values, exists) {
    for (const [name, value] of Object.entries(values)) if (!exists(name, value)) delete values[name];
  }

  /* Return a function that returns a sentence if an experiment does not take a value. */
  const limitsOf = ({ zero, min, ...about }) => live.limits({ ...about, min: zero ? 0 : min });

  /* ---- controls ---------------------------------------------------------------------------------------------- */

  function change(group, name, value, start) {
    if (value === start) delete state[group][name];
    else state[group][name] = value;
    if (group === "setup") results = [];
    else results[ROLES.indexOf(group)] = undefined;
    presets.value = "";
    redraw();
  }

  function row(group, about, label) {
    const { start } = about;
    const made = live.row({ ...about, label, id: group + "-" + about.name }, (name, value) => change(group, name, value, start));
    if (about.name in state[group]) made.value = state[group][about.name];
    return made.element;
  }

  function modelRows(side, run) {
    const { main, more } = parametersOf(run);
    const made = (variable) => {
      const name = variable.name.slice(prefix().length);
      const { unit = "", description = "", min = -Infinity, max = Infinity, type } = variable;
      const about = { name, text: description, unit, start: Number(variable.start), min, max, type };
      return row(ROLES[side], { ...about, ...live.rangeOf(about, typicalOf(unit, main)), accepts: live.limits(about) });
    };
    const rest = more.length ? [element("details", {}, element("summary", {}, "More parameters"), ...more.map(made))] : [];
    return [...main.map(made), ...rest];
  }

  function group(title, rows, role) {
    return element("details", { open: true, className: "group " + (role || "") }, element("summary", {}, title), ...rows);
  }

  /* ---- drawing ----------------------------------------------------------------------------------------------- */

  function compute(side) {
    const run = runs.get(side + scriptOf(state.models[side]));
    const { main, more } = parametersOf(run);
    const given = valuesOf(side);
    return view.compute(run, { ...Object.fromEntries([...main, ...more].map(({ name, start }) => [name, start])), ...given }, setup());
  }

  function draw() {
    if (broken) return;
    const sides = state.models.map((name, side) => side);
    const sentences = [];
    for (const side of sides) {
      try {
        results[side] ||= compute(side);
        sentences.push(state.models[side] + " " + results[side].text);
      } catch (error) {
        results[side] = undefined;
        sentences.push(state.models[side] + " does not run with these values: " + error.message);
      }
    }
    charts.forEach((chart, i) => {
      const curves = [];
      sides.forEach((side) => {
        for (const curve of results[side]?.charts[i] || []) {
          const role = curve.aside ? "aside" : curve.measured ? "measured" : ROLES[side];
          if (role === ROLES[side] || side === 0 || !results[0]) curves.push({ ...curve, role, label: curve.label || state.models[side] });
        }
      });
      if (curves.length) chart.draw(curves);
    });
    result.textContent = results.some((each) => each && each.text) || sentences.some((each) => /does not run/.test(each)) ? sentences.join("; ") + "." : "";
    history.replaceState(null, "", share.toHash(state));
    exportTexts();
  }

  const redraw = live.redrawing(draw, result);

  /* ---- texts ------------------------------------------------------------------------------------------------- */

  function paper(side) {
    const name = state.models[side];
    const { summary, equations, source, bibtex } = live.about[name];
    return element("article", { className: "paper " + ROLES[side] }, element("h2", {}, name), element("p", {}, summary + ". "),
      element("div", { innerHTML: equations }),
      element("p", {}, "Source: " + source + "."),
      element("details", {}, element("summary", {}, "BibTeX"), element("pre", { tabIndex: 0, "aria-label": "BibTeX of " + name }, bibtex)));
  }

  /* A model with what is changed, for programs to copy: the system file, and the unconnected inputs. */
  function copiedSide(model, side) {
    const run = runs.get(side + scriptOf(model));
    const driven = view.part === "block" ? ["v", "F_ext"] : view.system(setup()).force ? ["axis.F_load"] : [];
    const open = [...run.model.variables.values()].filter(({ name, causality }) => causality === "input" && !driven.includes(name));
    return {
      model,
      changed: live.sided(state[ROLES[side]]),
      pushed: run.has("F_ext"),
      toml: (live.about[scriptOf(model)] || {}).toml,
      inputs: Object.fromEntries(open.map(({ name, start }) => [view.part === "block" ? "friction." + name : name, Number(start)])),
    };
  }

  /* Return what the shown experiment can be copied as, name -> function that returns the text. A system file has one model and no force that varies. */
  function formats() {
    const sides = state.models.map(copiedSide);
    const loop = view.system && view.system(setup());
    const found = {};
    if (view.id === "contact") {
      found.Python = () => share.ofContact(sides, setup(), live.about[state.models[0]].reach);
    }
    if (loop) found.Python = () => share.toPython(sides, loop);
    if (loop && !loop.force) {
      sides.forEach((each, side) => {
        found["TOML of " + each.model + (side && each.model === sides[0].model ? ", compared" : "")] = () => share.toToml(each, loop);
      });
    }
    return { ...found, [sides.length > 1 ? "build commands" : "build command"]: () => sides.map(share.toCommand).join("\n") };
  }

  const format = element("select", { id: "format" });
  const source = element("pre", { tabIndex: 0, "aria-label": "Text to copy" });
  const copied = element("span", { role: "status" });

  async function copy(what) {
    try {
      await navigator.clipboard.writeText(what);
      copied.textContent = "Copied.";
    } catch {
      copied.textContent = "Select the text and copy it: this browser does not let the page do it.";
    }
    setTimeout(() => (copied.textContent = ""), 4000);
  }

  exported.append(
    element("h2", {}, "Copy these settings"),
    element("p", { className: "copies" }, field("as", format), " ",
      element("button", { type: "button", onclick: () => copy(source.textContent) }, "Copy"), " ",
      element("button", { type: "button", onclick: () => copy(location.href) }, "Copy link"), " ", copied),
    source);
  format.addEventListener("change", exportTexts);

  function exportTexts() {
    const texts = formats(), names = Object.keys(texts), chosen = names.includes(format.value) ? format.value : names[0];
    format.replaceChildren(...names.map((name) => element("option", { selected: name === chosen }, name)));
    source.textContent = texts[chosen]();
  }

  function showClaim() {
    const preset = live.presets.find(({ id }) => id === presets.value);
    claim.replaceChildren();
    if (!preset) return;
    const pages = lab.dataset.pages || "../";
    claim.append(
      element("p", {}, element("q", {}, preset.claim), " ", preset.try),
      element("p", { className: "links" }, element("a", { href: pages + "effects.html#" + preset.effect }, "The effect"), ", its script ",
        element("code", {}, "examples/" + preset.script), ", and ", element("a", { href: pages + "literature.html" }, "the claims"), "."));
  }

  /* ---- changes of view and models ---------------------------------------------------------------------------- */

  function options() {
    names.forEach((select, side) => {
      const none = side === 1 ? [element("option", { value: "" }, "no other")] : [];
      select.replaceChildren(...none, ...live.catalogue.models.map((name) =>
        element("option", { value: name, disabled: !possible(name) }, name + (possible(name) ? "" : " (without a mass only)"))));
      select.value = state.models[side] || "";
    });
    views.value = state.view;
  }

  async function show(next) {
    state = next;
    view = live.views.find(({ id }) => id === state.view);
    state.models = state.models.map((name) => (possible(name) ? name : "LuGre"));
    results = [];
    text.textContent = view.text;
    options();
    showClaim();
    const mine = state;
    try {
      await Promise.all(state.models.map((name, side) => Promise.all([runOf(side), live.load(name)])));
      broken = false;
    } catch (error) {
      broken = true;
      result.textContent = error.message;
      return;
    }
    if (state !== mine) return;
    state.models.forEach((name, side) => known(state[ROLES[side]], (each) => runs.get(side + scriptOf(name)).model.variables.get(prefix() + each)?.causality === "parameter"));
    known(state.setup, (each, given) => view.controls.some((control) => control.name === each && !limitsOf(control)(given)));
    drawn.replaceChildren();
    charts = view.charts.map((about) => live.chart(drawn.appendChild(element("figure")), about));
    drop.replaceChildren(...(view.id === "record" ? recordRows() : []));
    const settings = view.controls.map((about) => {
      const start = startOf(about.name, about.start);
      return row("setup", { ...about, start, accepts: limitsOf(about) });
    });
    const friction = state.models.map((name, side) => group(name, modelRows(side, runs.get(side + scriptOf(name))), ROLES[side]));
    const experiment = settings.length ? [group(view.part === "axis" ? "Controller and motion" : "Experiment", settings)] : [];
    controls.replaceChildren(...(view.part === "axis" ? [...experiment, ...friction] : [...friction, ...experiment]));
    papers.replaceChildren(...state.models.map((_, side) => paper(side)));
    draw();
    lab.dataset.ready = state.view;
  }

  function recordRows() {
    const input = element("input", { type: "file", accept: ".csv,.txt,text/csv", id: "record" });
    const said = element("p", { role: "status" });
    const take = async (file) => {
      try {
        said.textContent = await live.record.open(file);
        results = [];
        redraw();
      } catch (error) {
        said.textContent = error.message;
      }
    };
    input.addEventListener("change", () => input.files[0] && take(input.files[0]));
    lab.ondragover = (event) => event.preventDefault();
    lab.ondrop = (event) => {
      event.preventDefault();
      if (view.id === "record" && event.dataTransfer.files[0]) take(event.dataTransfer.files[0]);
    };
    return [field("CSV file", input), said];
  }

  presets.addEventListener("change", () => {
    const preset = live.presets.find(({ id }) => id === presets.value);
    if (preset) show(share.ofPreset(preset));
  });
  views.addEventListener("change", () => {
    presets.value = "";
    show({ ...state, view: views.value, setup: {} });
  });
  names.forEach((select, side) => select.addEventListener("change", () => {
    const models = [...state.models];
    models[side] = select.value;
    presets.value = "";
    show({ ...state, models: models.filter(Boolean), [ROLES[side]]: {} });
  }));
  addEventListener("hashchange", () => {
    const next = share.fromHash(location.hash);
    if (next) show(next);
  });
  live.onTheme(() => charts && charts.forEach((chart) => chart.redraw()));
  const asked = new URLSearchParams(location.hash.slice(1)).get("preset");
  if (live.presets.some(({ id }) => id === asked)) presets.value = asked;
  show(share.fromHash(location.hash) || { view: "contact", models: ["LuGre", "GMS"], setup: {}, first: {}, second: {} });
})(FrictionLive);
