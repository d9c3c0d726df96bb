/* A recorded motion: read from a CSV file that stays on the computer, and followed by the models. */
(function (live) {
  "use strict";
  const MOST_ROWS = 40000;
  const SIZES = { n: 1e-9, u: 1e-6, "µ": 1e-6, "μ": 1e-6, m: 1e-3, c: 1e-2, k: 1e3 };
  const MEANINGS = {
    t: /^(t|time|zeit)$/, x: /^(x|pos|position|displacement|q)$/, v: /^(v|vel|velocity|speed|dx|qd)$/, F: /^(f|force|friction|ffric|f_friction)$/,
  };
  const BASES = { t: ["s"], x: ["m"], v: ["m/s"], F: ["n"] };

  /* Return the factor to the SI unit, or NaN for a unit of something else. */
  function factorOf(unit, key) {
    const given = unit.trim();
    for (const base of BASES[key]) {
      if (given === "" || given.toLowerCase() === base) return 1;
      const size = SIZES[given[0]];
      if (size && given.slice(1).toLowerCase() === base) return size;
    }
    return NaN;
  }

  /* Return what a heading such as "x [mm]", "v_mm/s" or "F (N)" stands for. */
  function headingOf(text) {
    const found = /^\s*"?\s*([A-Za-z_]+?)\s*(?:[[(]([^\])]*)[\])]|_([A-Za-zµμ/]+)|)\s*"?\s*$/.exec(text);
    const name = found ? found[1].toLowerCase() : "";
    const key = Object.keys(MEANINGS).find((each) => MEANINGS[each].test(name));
    return key ? { key, unit: found[2] ?? found[3] ?? "" } : null;
  }

  function fail(sentence) {
    throw new Error(sentence);
  }

  /* Return t, x, v and F of a text; throw an error with one sentence about what is wrong. */
  function read(text) {
    const lines = text.replace(/^\ufeff/, "").split(/\r\n|\r|\n/).filter((line) => line.trim() && !/^[#%]/.test(line));
    if (lines.length < 4) fail("The file has fewer than three rows of numbers: give a heading and a row for each sample.");
    const separator = [";", "\t", ","].find((each) => lines[0].includes(each));
    if (!separator) fail("The heading has one column: separate columns by commas, semicolons or tabs.");
    const heads = lines[0].split(separator).map(headingOf);
    const columns = {};
    heads.forEach((head, place) => {
      if (head && !(head.key in columns)) columns[head.key] = { ...head, place };
    });
    for (const [key, what] of [["t", "time, t [s]"], ["F", "friction, F [N]"]]) {
      if (!columns[key]) fail("The heading names no column of " + what + ": it is " + lines[0].slice(0, 60) + ".");
    }
    if (!columns.x && !columns.v) fail("The heading names neither a position, x [m], nor a velocity, v [m/s].");
    const found = {};
    for (const [key, { unit, place }] of Object.entries(columns)) {
      const factor = factorOf(unit, key);
      if (!isFinite(factor)) fail('The unit "' + unit + '" of ' + key + " is unknown: use a multiple of " + BASES[key][0].replace("n", "N") + ".");
      found[key] = Float64Array.from(lines.slice(1), (line, i) => {
        const cells = line.split(separator), cell = (cells[place] ?? "").trim();
        if (cells.slice(heads.length).some((each) => each.trim())) fail("Row " + (i + 2) + " has " + cells.length + " cells, but the heading names " + heads.length + ": separate columns by semicolons if numbers have decimal commas.");
        const value = Number(separator === ";" ? cell.replace(",", ".") : cell);
        if (cell === "" || !isFinite(value)) fail("Row " + (i + 2) + ' has "' + cell.slice(0, 20) + '" in the column of ' + key + ": give a number.");
        return value * factor;
      });
    }
    const late = found.t.findIndex((t, i) => i > 0 && !(t > found.t[i - 1]));
    if (late > 0) fail("The time does not increase from row " + (late + 1) + " to row " + (late + 2) + ".");
    return even(found);
  }

  /* Return the record at equal steps, with the velocity from the positions if there is none. */
  function even({ t, x, v, F }) {
    const rows = Math.min(t.length, MOST_ROWS);
    const step = (t[t.length - 1] - t[0]) / (rows - 1);
    const times = Float64Array.from({ length: rows }, (_, i) => t[0] + i * step);
    let k = 0;
    const at = times.map((time) => {
      while (k < t.length - 2 && t[k + 1] < time) k++;
      return k + Math.min(Math.max((time - t[k]) / (t[k + 1] - t[k]), 0), 1);
    });
    const resampled = (y) => at.map((place) => {
      const i = Math.min(Math.floor(place), y.length - 2);
      return y[i] + (place - i) * (y[i + 1] - y[i]);
    });
    const force = resampled(F);
    if (v) return { t: times, v: resampled(v), F: force, step, linear: true };
    const path = resampled(x);
    return { t: times, v: path.map((_, i) => (i < rows - 1 ? (path[i + 1] - path[i]) / step : 0)), F: force, step, linear: false };
  }

  let record = null;

  /* Take a file; return a sentence about it, or throw an error with one. */
  async function open(file) {
    if (file.size > 50e6) fail("The file has more than 50 MB: give a part of the record.");
    record = read(await file.text());
    return file.name + ": " + record.t.length + " samples in " + live.quantity(record.t[record.t.length - 1] - record.t[0], "s");
  }

  live.views.push({
    id: "record",
    title: "Your record",
    text: "The models follow the motion of a CSV file with columns such as t [s], x [mm] or v [m/s], and F [N], positive while v is positive. It stays on this computer.",
    part: "block",
    controls: [],
    charts: [
      { title: "Force over time", x: ["time", "s"], y: ["force", "N"], tight: true },
      { title: "Force over velocity", x: ["velocity", "m/s"], y: ["force", "N"] },
    ],
    compute(run, values) {
      if (!record) return { charts: [[], []], text: "" };
      const { t, v, F, step, linear } = record;
      run.begin(values);
      const model = run.advance(step, t.length - 1, live.moving(run, v, live.pushing(values)), ["F"], linear).F;
      const difference = Math.sqrt(model.reduce((sum, each, i) => sum + (i > 0 ? (each - F[i]) ** 2 : 0), 0) / (F.length - 1));
      model[0] = NaN; /* before the first step, the model does not know how it came there */
      const speed = linear ? v : v.map((_, i) => v[Math.max(i - 1, 0)]);
      return {
        charts: [
          [{ x: t, y: F, measured: true, label: "measured" }, { x: t, y: model }],
          [{ x: speed, y: F, measured: true, label: "measured" }, { x: speed, y: model }],
        ],
        text: "differs from the measured force by " + live.quantity(difference, "N") + " (rms)",
      };
    },
  });
  live.record = { open, read, get loaded() { return record !== null; } };
})(FrictionLive);
