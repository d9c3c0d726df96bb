/* A row of a slider, a number field and a reset button, all for one value. */
(function (live) {
  "use strict";
  const STEPS = 1000;

  /* Return a text with elements in it. */
  function element(tag, properties = {}, ...children) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(properties)) {
      if (name in made) made[name] = value;
      else made.setAttribute(name, value);
    }
    made.append(...children);
    return made;
  }

  /* Return how positions 0 to STEPS of a slider belong to values: on a logarithmic scale if the range spans more than
     two decades, where position 0 is the value 0 if that is allowed. */
  function scaleOf({ min, max, zero, integer }) {
    const logarithmic = min > 0 && max / min > 100;
    const first = zero ? 1 : 0;
    const toValue = (position) => {
      if (zero && position < first) return 0;
      const share = (position - first) / (STEPS - first);
      const value = logarithmic ? min * Math.pow(max / min, share) : min + share * (max - min);
      return integer ? Math.round(value) : Number(value.toPrecision(3));
    };
    const toPosition = (value) => {
      if (zero && value <= 0) return 0;
      const share = logarithmic ? Math.log(Math.max(value, min) / min) / Math.log(max / min) : (value - min) / (max - min);
      return Math.min(Math.max(first + share * (STEPS - first), first), STEPS);
    };
    return { toValue, toPosition };
  }

  /* Make a row. `about`: name, text, unit, start, and the range of the slider; `accepts(value)` returns a sentence about
     a value that the model does not take, or nothing. */
  function slider(about, onInput) {
    const id = "value-" + (about.id || about.name).replace(/[^\w]+/g, "-");
    const { toValue, toPosition } = scaleOf(about);
    let value = about.start;
    const [factor, shownUnit] = /^m?(\/?s)?$/.test(about.unit) ? live.readable(Math.abs(value) || about.max, about.unit) : [1, about.unit];
    const range = element("input", { type: "range", min: 0, max: STEPS, step: 1, id });
    const number = element("input", { type: "number", step: "any", "aria-label": about.name + " in " + (shownUnit || "1") });
    const reset = element("button", { type: "button", className: "reset", title: "Reset " + about.name, textContent: "↺" });
    reset.setAttribute("aria-label", "Reset " + about.name);
    const problem = element("p", { className: "problem", hidden: true, role: "alert" });
    const label = element("label", { htmlFor: id }, element("b", {}, about.label || about.name), " ", about.text);
    const unit = element("span", { className: "unit" }, live.spaced(shownUnit));
    const row = element("div", { className: "slider" }, label, range, number, unit, reset, problem);

    function show(typed) {
      range.value = toPosition(value);
      range.setAttribute("aria-valuetext", live.quantity(value, about.unit));
      if (!typed) number.value = Number((value * factor).toPrecision(6));
      reset.disabled = value === about.start;
    }

    function take(given, typed) {
      const fault = typeof given === "number" && isFinite(given) ? about.accepts && about.accepts(given) : about.name + " must be a number.";
      problem.hidden = !fault;
      problem.textContent = fault || "";
      if (fault) return;
      value = given;
      show(typed);
      onInput(about.name, value);
    }

    range.addEventListener("input", () => take(toValue(Number(range.value))));
    number.addEventListener("input", () => take(Number((number.valueAsNumber / factor).toPrecision(15)), true));
    number.addEventListener("change", () => show());
    reset.addEventListener("click", () => {
      take(about.start);
      range.focus();
    });
    show();
    return {
      element: row,
      get value() {
        return value;
      },
      set value(given) {
        value = given;
        problem.hidden = true;
        show();
      },
    };
  }

  Object.assign(live, { element, slider });
})(FrictionLive);
