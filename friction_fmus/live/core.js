/* Loads compiled models and runs them. A model is a classic script, so that a page also works as a file. */
var FrictionLive = (function () {
  "use strict";
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
      loading.set(name, script(folder + "../models/" + name + ".js").then(() => frictionFmus.load(name)));
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

  const PREFIXES = [[1e-9, "n"], [1e-6, "µ"], [1e-3, "m"], [1, ""], [1e3, "k"], [1e6, "M"], [1e9, "G"]];
  const PREFIXED = /^(m|N|s|Hz)([/.].*)?$/;

  /* Return the factor and the name of the unit in which values up to `most` are easy to read. */
  function readable(most, unit) {
    if (!PREFIXED.test(unit) || !(most > 0)) return [1, unit];
    const kept = unit === "s" || unit === "Hz" ? PREFIXES.slice(0, 4) : PREFIXES;
    const [size, prefix] = kept.reduce((found, each) => (most >= 0.9999 * each[0] ? each : found), kept[0]);
    return [1 / size, prefix + unit];
  }

  /* Return a unit in which a space separates the factors. */
  const spaced = (unit) => unit.replace(/\./g, "\u00a0");

  /* Return a value with unit, to some digits. */
  function quantity(value, unit, digits = 3) {
    const [factor, name] = readable(Math.abs(value), unit);
    return Number((value * factor).toPrecision(digits)) + (name ? "\u00a0" + spaced(name) : "");
  }

  return { about, load, Run, SIDES, sided, readable, spaced, quantity };
})();
