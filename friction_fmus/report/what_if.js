/* The what-if panel: the sliders, and runs of the axis in WebAssembly. */
(async function () {
  "use strict";
  const FIRST = 50, NEXT = 40; // ms of computing before the first drawing, and before each later one
  const CHUNK = 500; // samples
  const COLUMNS = 900; // the smallest and the largest value of each are drawn
  const ROLES = ["first", "second"];
  const { chart, element, onTheme, redrawing, slider } = FrictionLive;
  const panel = document.getElementById("what-if");
  const told = JSON.parse(document.getElementById("what-if-data").textContent);
  const { Ts } = told;

  const bytes = (text) => Uint8Array.from(atob(text), (character) => character.charCodeAt(0)).buffer;
  const padded = (values) => Float64Array.from({ length: values.length + 1 }, (_, k) => values[Math.min(k, values.length - 1)]);
  const r = padded(new Float64Array(bytes(told.r)));
  const samples = r.length - 1;
  r[samples] = 2 * r[samples - 1] - r[samples - 2]; // the study also goes on with the last velocity
  const slope = (values) =>
    values.map((_, k) => {
      const [from, to] = [Math.max(k - 1, 0), Math.min(k + 1, samples)];
      return (values[to] - values[from]) / ((to - from) * Ts);
    });
  const rd = slope(r);
  const sources = { "reference.r": r, "reference.rd": rd, "reference.rdd": slope(rd) };
  if (told.noise) sources["noise.r"] = padded(new Float32Array(bytes(told.noise)));
  const times = Float64Array.from({ length: samples }, (_, k) => (k - told.runUp) * Ts);

  const runs = await Promise.all(
    told.runs.map(async ({ model, label }, i) => {
      const loaded = await frictionFmus.load(model);
      const inputs = Object.keys(sources).filter((name) => loaded.variables.has(name));
      const block = loaded.instantiate(Object.fromEntries(inputs.map((name) => [name, sources[name][0]])));
      const position = ["axis.x", "axis.x1"].find((name) => loaded.variables.has(name)); // x1 is that of the motor
      const role = told.runs.length > 1 ? ROLES[i] : ROLES[0];
      return { block, label, inputs, position, role, number: i, shown: true };
    }),
  );

  /* Return the parameters of a run for the values of the sliders. */
  function settings(run) {
    const found = {};
    for (const { about, row } of knobs) {
      for (const [name, factor] of Object.entries(about.settings[run.number])) found[name] = factor * row.value;
      about.taps.forEach((name, k) => (found[name] = Number(k === row.value - about.min)));
    }
    return found;
  }

  function begin(run) {
    if (run.done === samples) run.before = { error: run.error, force: run.force };
    Object.assign(run, { error: new Float64Array(samples), force: new Float64Array(samples), done: 0, failure: "" });
    try {
      run.block.reset(settings(run));
    } catch (error) {
      run.failure = error.message;
    }
  }

  function advance(run) {
    const steps = Math.min(CHUNK, samples - run.done);
    const rows = (values) => values.subarray(run.done, run.done + steps + 1);
    const inputs = Object.fromEntries(run.inputs.map((name) => [name, rows(sources[name])]));
    try {
      const found = run.block.run({ step: Ts, steps, inputs, outputs: [run.position, "servo.u"] });
      for (let k = 0; k < steps; k++) {
        run.error[run.done + k] = r[run.done + k] - found[run.position][k];
        run.force[run.done + k] = found["servo.u"][k + 1];
      }
      run.done += steps;
    } catch (error) {
      run.failure = error.message;
    }
  }

  const going = (run) => run.done < samples && !run.failure;

  /* Go on with all runs for a time [ms]: those that are shown first, and of these the one that is behind. */
  function compute(limit) {
    const end = performance.now() + limit;
    while (runs.some(going) && performance.now() < end) {
      const left = runs.filter((run) => run.shown && going(run));
      advance((left.length ? left : runs.filter(going)).reduce((last, run) => (run.done < last.done ? run : last)));
    }
    return !runs.some(going);
  }

  let view = null; // begin and end of what is drawn [s], or null for everything

  /* Return the points of a curve between two samples: the extremes in each column. */
  function thin(x, y, to, from = 0) {
    const inside = (t) => !view || (t >= view[0] && t <= view[1]);
    while (from < to && !inside(x[from])) from++;
    while (to > from && !inside(x[to - 1])) to--;
    const width = Math.max(1, (to - from) / COLUMNS);
    const found = { x: [], y: [] };
    for (let left = from; left < to; left += width) {
      let [low, high] = [Math.floor(left), Math.floor(left)];
      for (let k = low; k < Math.min(left + width, to); k++) {
        if (y[k] < y[low]) low = k;
        if (y[k] > y[high]) high = k;
      }
      for (const k of low === high ? [low] : [Math.min(low, high), Math.max(low, high)]) {
        found.x.push(x[k]);
        found.y.push(y[k]);
      }
    }
    return found;
  }

  const { position, force } = told.units;
  const most = (values) => values.reduce((found, value) => Math.max(found, Math.abs(value)), 0);
  // the recorded servo may have an error so much larger that it hides all others
  const record = { label: "recorded error", shown: Boolean(told.recorded.error) && most(told.recorded.error.y) < 2 * told.largest };
  const errors = chart(document.getElementById("what-if-error"), {
    title: "Tracking error", heading: "h3", x: ["time", "s"], y: ["error", position], tight: true,
  });
  const forces = chart(document.getElementById("what-if-force"), {
    title: "Drive " + told.forceName, heading: "h3", x: ["time", "s"], y: [told.forceName, force], tight: true,
  });

  /* Return what was recorded, as a list of no curve or one. */
  function recorded(name) {
    const found = told.recorded[name];
    const points = found && thin(found.t, found.y, found.t.length);
    return points && points.x.length ? [{ ...points, label: "recorded", role: "measured" }] : [];
  }

  function draw() {
    const seen = runs.filter((run) => run.shown && run.done);
    const size = new Map(seen.map((run) => [run, most(run.error)]));
    const behind = [...seen].sort((a, b) => size.get(b) - size.get(a) || b.number - a.number); // the larger error
    const curves = (name) => behind.map((run) => ({ ...thin(times, run[name], run.done), label: run.label, role: run.role }));
    const report = seen.map((run) => ({ ...thin(times, run.report.error, samples), label: "report", role: "aside" }));
    // what the last run was like, for the time that this one has not reached yet
    const rest = (name) => seen.map((run) => ({ ...thin(times, (run.before || run)[name], samples, run.done), label: "", role: "aside" }));
    errors.draw([...(record.shown ? recorded("error") : []), ...(changed() ? report : []), ...rest("error"), ...curves("error")]);
    forces.draw([...recorded("force"), ...rest("force"), ...curves("force")]);
  }

  /* Return a length or an angle as the report prints it. */
  function quantity(value) {
    const units = position === "m" ? ["m", "mm", "\u00b5m", "nm"] : ["rad", "mrad", "\u00b5rad"];
    const found = units.findIndex((_, k) => value * 1000 ** k >= 1);
    const place = found < 0 ? units.length - 1 : found;
    const shown = value * 1000 ** place;
    return Number(shown.toPrecision(3)).toFixed(Math.max(0, 2 - Math.floor(Math.log10(Number(shown.toPrecision(3)) || 1)))) + "\u00a0" + units[place];
  }

  const rows = [...panel.querySelectorAll("tbody tr")];
  const said = panel.querySelector(".said");
  const span = r.reduce((found, value) => Math.max(found, value), -Infinity) - r.reduce((found, value) => Math.min(found, value), Infinity);

  const mean = r.reduce((sum, value) => sum + value, 0) / r.length;
  const still = Math.sqrt(r.reduce((sum, value) => sum + (value - mean) ** 2, 0) / r.length); // error of an axis that never moves
  const travel = (x) => x.reduce((sum, value, k) => sum + Math.abs(value - x[Math.max(k - 1, 0)]), 0);

  function summarise() {
    const results = runs.map((run, i) => {
      let [square, largest] = [0, 0];
      for (const error of run.error) {
        square += error * error;
        largest = Math.max(largest, Math.abs(error));
      }
      const rms = Math.sqrt(square / samples);
      const failed = run.failure || !(largest < span && rms < still);
      const stuck = failed && travel(run.error.map((error, k) => r[k] - error)) < travel(r);
      [rms, largest].forEach((value, k) => {
        rows[i].querySelectorAll(".now")[k].textContent = failed ? "\u2013" : quantity(value);
      });
      return { rms, failed, stuck, failure: run.failure && " (the simulation ends after " + (run.done * Ts).toPrecision(3) + " s: " + run.failure + ")" };
    });
    const [good, text] = verdict(...results);
    said.textContent = text;
    said.className = "said " + (good ? "good" : "bad");
  }

  /* Return whether the first run is as it should be, and a sentence about it; the second one is the servo alone. */
  function verdict(first, alone) {
    const delay = knobs.find(({ about }) => about.name === "delay");
    const more = delay.row.value - delay.about.start;
    const [loop, beside] = alone ? ["with the recommended compensator", alone.failed ? " The servo alone fails, too." : " The servo alone is stable."] : ["", ""];
    if (first.stuck) return [false, ("The axis does not follow the reference " + loop).trim() + "." + beside];
    const late = told.delayMargin !== null && more > told.delayMargin; // then a limit cycle
    if (first.failed || (late && alone && (alone.failed || first.rms > alone.rms))) {
      const why = late ? ": " + more + " more samples of delay exceed the margin of " + told.delayMargin : "";
      return [false, ("Unstable " + loop).trim() + why + (first.failure || "") + "." + beside];
    }
    if (!alone) return [true, "Stable: the tracking error is " + quantity(first.rms) + " rms."];
    if (alone.failed) return [true, "Stable " + loop + ", " + quantity(first.rms) + " rms; the servo alone fails."];
    const ratio = alone.rms / first.rms;
    if (ratio < 1) return [false, "Worse " + loop + ": " + quantity(first.rms) + " rms instead of " + quantity(alone.rms) + "."];
    const times = ratio < 1.05 ? "about as much as" : Number(ratio.toPrecision(2)) + " times less than";
    return [ratio >= 1.05, "The tracking error " + loop + " is " + quantity(first.rms) + " rms, " + times + " the " + quantity(alone.rms) + " of the servo alone."];
  }

  const changed = () => knobs.some(({ about, row }) => row.value !== about.start);
  let started = 0, waiting;

  function finish(whole) {
    clearTimeout(waiting);
    panel.setAttribute("aria-busy", String(!whole));
    if (whole) {
      summarise();
      performance.measure("complete", { start: started, end: performance.now() });
      return;
    }
    waiting = setTimeout(() => {
      const now = compute(NEXT);
      draw();
      finish(now);
    });
  }

  const redraw = redrawing(() => {
    runs.forEach(begin);
    const whole = compute(FIRST);
    draw();
    finish(whole);
  });

  function update() {
    if (panel.getAttribute("aria-busy") !== "true") started = performance.now();
    resets.disabled = !changed();
    redraw();
  }

  const knobs = told.knobs.map((about) => {
    const row = slider(
      {
        ...about,
        text: about.text + "; report: " + about.start + (about.unit === "\u00d7" || about.integer ? "" : "\u00a0" + about.unit),
        id: "what-if-" + about.name,
        accepts: (value) => {
          const least = about.zero ? 0 : about.min;
          if (value < least || value > about.max) return about.name + " must be between " + least + " and " + about.max + ".";
          return about.integer && value % 1 !== 0 ? about.name + " must be a whole number." : "";
        },
      },
      update,
    );
    const range = row.element.querySelector("input[type=range]");
    const mark = element("datalist", { id: range.id + "-report" }, element("option", { value: range.value }));
    range.setAttribute("list", mark.id);
    row.element.append(mark);
    return { about, row };
  });
  const resets = element("button", { type: "button", textContent: "Reset all", disabled: true });
  resets.addEventListener("click", () => {
    for (const { about, row } of knobs) row.value = about.start;
    update();
  });
  const views = Object.entries({ "whole run": null, ...told.views }).map(([name, span]) => {
    const button = element("button", { type: "button", textContent: name });
    button.setAttribute("aria-pressed", String(span === null));
    button.addEventListener("click", () => {
      view = span;
      views.forEach((each) => each.setAttribute("aria-pressed", String(each === button)));
      draw();
    });
    return button;
  });
  const tools = (name, ...buttons) => {
    const group = element("div", { className: "tools", role: "group" }, ...buttons);
    group.setAttribute("aria-label", name);
    return group;
  };
  const boxes = [...runs, ...(told.recorded.error ? [record] : [])].map((run) => {
    const box = element("input", { type: "checkbox", checked: run.shown });
    box.addEventListener("input", () => {
      run.shown = box.checked;
      draw();
    });
    return element("label", { className: "check" }, box, " show " + run.label);
  });
  panel.querySelector(".controls").append(...knobs.map(({ row }) => row.element), tools("Sliders", resets));
  if (views.length > 1) panel.querySelector(".controls").append(tools("Time", ...views));
  if (boxes.length > 1) panel.querySelector(".controls").append(...boxes);

  // the values of the report first, to draw its curves beside others
  runs.forEach(begin);
  while (!compute(NEXT)) await new Promise((resolve) => setTimeout(resolve));
  panel.hidden = false;
  document.querySelector(".what-if-picture").classList.add("replaced");
  for (const run of runs) run.report = { error: run.error.slice() };
  draw();
  summarise();
  onTheme(() => [errors, forces].forEach((each) => each.redraw()));
  panel.dataset.ready = "";
})().catch((error) => {
  console.error(error);
  document.getElementById("what-if").hidden = true;
  document.querySelector(".what-if-picture").classList.remove("replaced");
});
