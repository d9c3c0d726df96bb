/* Loads compiled models, runs them, and makes the rows of their parameters. A model is a classic script, so that a page
   also works as a file. */
(function (live) {
  "use strict";
  const { element } = live;
  const folder = document.currentScript.src.replace(/[^/]*$/, "");
  const loading = new Map();

  /* What the scripts of models tell beside their variables, by name of the model. */
  const about = {};

  function script(source) {
    return new Promise((resolve, reject) => {
      const element = document.createElement("script");
      element.src = source;
      element.onload = resolve;
      element.onerror = () => reject(new Error("The model cannot be loaded from " + source + ": reload the page."));
      document.head.append(element);
    });
  }

  /* Return the promise of a model; its script is loaded when it is first needed. */
  function load(name) {
    if (!loading.has(name)) {
      loading.set(name, script(folder + "models/" + name + ".js").then(() => frictionFmus.load(name)));
    }
    return loading.get(name);
  }

  /* An instance that is run from its start again and again. */
  class Run {
    constructor(model) {
      this.model = model;
      this.about = about[model.name] || {};
      this.block = model.instantiate();
    }

    has(name) {
      return this.model.variables.has(name);
    }

    /* Return whether a name is that of an input. */
    takes(name) {
      return this.has(name) && this.model.variables.get(name).causality === "input";
    }

    /* Start anew with these values. */
    begin(values) {
      this.block.reset(values);
    }

    /* Make steps, and return the outputs before the first and after each one. Inputs are numbers, which are held, or
       arrays of a value for each row, held or `linear` in between. */
    advance(step, steps, inputs, outputs, linear = false) {
      return this.block.run({ step, steps, inputs, outputs, interpolation: linear ? "linear" : "hold" });
    }
  }

  /* The parameter that separates the directions of motion. */
  const SIDES = "asymmetric";

  /* Return changed values; with one of the negative direction, the directions are separate. */
  const sided = (changed) => (Object.keys(changed).some((name) => /_neg$/.test(name)) ? { ...changed, [SIDES]: 1 } : changed);

  /* Parameters that are seldom changed: elements of arrays, of one direction, and switches. */
  const isRare = ({ name, type }) => /\[|_neg$|^(Fn0|v_d|dead_band|seed|dt)$/.test(name) || type === "Boolean";

  /* Make a row for a value that is true or false. */
  function check(about, onInput) {
    const input = element("input", { type: "checkbox", checked: Boolean(about.start) });
    const row = element("label", { className: "check" }, input, " ", element("b", {}, about.label || about.name), " " + about.text);
    input.addEventListener("input", () => onInput(about.name, Number(input.checked)));
    return {
      element: row,
      get value() {
        return Number(input.checked);
      },
      set value(given) {
        input.checked = Boolean(given);
      },
    };
  }

  /* Make a row for a number or for a value that is true or false. */
  const row = (about, onInput) => (about.boolean ? check(about, onInput) : live.slider(about, onInput));

  /* Return the range of a slider for a variable of a model. `typical`: magnitude for a start value of zero. */
  function rangeOf({ start, min, max, type }, typical) {
    if (type === "Boolean") return { boolean: true };
    const integer = type === "Integer";
    const size = Math.abs(start) || typical || 1;
    if (isFinite(min) && isFinite(max) && max / Math.max(min, size / 100) < 1000) return { min, max, integer };
    if (integer) return { min: Math.max(min, 0), max: Math.min(max, Math.max(4 * size, 10)), integer };
    if (min < 0) return { min: Math.max(min, -3 * size), max: Math.min(max, 3 * size) };
    return { min: Math.max(min, size / 100), max: Math.min(max, size * 100), zero: min <= 0 };
  }

  /* Return a function that returns a sentence if a variable of a model does not take a value. */
  function limits({ name, unit, min, max, type }) {
    const limit = (value) => value + (unit ? " " + live.spaced(unit) : "") + ".";
    return (value) => {
      if (value < min) return name + " must be at least " + limit(min);
      if (value > max) return name + " must be at most " + limit(max);
      return type === "Integer" && value % 1 !== 0 ? name + " must be a whole number." : "";
    };
  }

  Object.assign(live, { about, load, Run, SIDES, sided, isRare, row, rangeOf, limits });
})(FrictionLive);
