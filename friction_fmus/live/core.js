/* Numbers with units, as a page shows them. The scripts after this one add sliders and charts. */
var FrictionLive = (function () {
  "use strict";
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

  return { readable, spaced, quantity };
})();
